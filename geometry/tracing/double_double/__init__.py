"""The compiled tracer in double-double arithmetic."""

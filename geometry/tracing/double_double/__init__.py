"""The compiled loop of the tracer in double-double arithmetic."""

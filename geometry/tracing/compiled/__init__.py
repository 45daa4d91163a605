"""The compiled loops of the tracer: one ray in doubles and in double-doubles, many rays in waves and closed forms."""

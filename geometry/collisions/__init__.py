"""The true disk against a rough wall, and the cylinder that replaces its configurations."""

"""The quantities and walls of the standard set."""

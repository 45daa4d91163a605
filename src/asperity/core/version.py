"""The version of asperity."""

__version__ = "0.1.0"

"""The running of measurements: processes that can be ended, timing, stored references."""

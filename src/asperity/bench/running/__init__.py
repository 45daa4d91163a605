"""Running of measurements: processes that can be killed, timing, stored references."""

"""How measurements run: processes that can be ended, timing, stored references."""

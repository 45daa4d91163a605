"""The compiled function that traces rays on height maps."""

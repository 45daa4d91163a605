"""The types of records and tables in compiled functions."""

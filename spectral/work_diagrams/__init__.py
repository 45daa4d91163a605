"""Diagrams of error against run time: problems, measured runs, fitted orders and reports."""

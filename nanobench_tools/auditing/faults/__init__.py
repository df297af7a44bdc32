"""Faults of data, one file per kind."""

"""Metrics, one file per family; each equation is here once."""

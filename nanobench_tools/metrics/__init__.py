"""Metrics, one file per family; each equation stands here once."""

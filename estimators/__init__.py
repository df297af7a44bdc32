"""Estimators: one file per row of Task 3."""

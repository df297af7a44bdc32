"""Identification: predictors of Task 1, one file each."""

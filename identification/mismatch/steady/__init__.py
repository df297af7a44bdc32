"""Diagnosis from the steady trim: changes of a vehicle relative to its normal flights."""

"""Diagnosis from the steady trim: what changed on a vehicle, against its own normal flights."""

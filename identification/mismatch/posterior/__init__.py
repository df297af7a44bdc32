"""Diagnosis by posterior: the residual wrench as a sum of effects, offsets of flights, a discrepancy and noise."""

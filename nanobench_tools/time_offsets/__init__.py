"""Errors of timestamps: mathematics, constant offsets, and offsets that move within a flight."""

"""Predictive controllers: one beat from measurement to command, its model, programs and plans."""

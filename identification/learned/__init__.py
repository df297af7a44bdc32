"""Learned models of Task 1: the published baselines, and a small network on top of identified physics. JAX is loaded
when something is trained or predicted, never on import."""

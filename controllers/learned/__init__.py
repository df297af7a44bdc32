"""Learned controllers of Task 2: policies cloned from the onboard PID, and MPPI. JAX is loaded when one is trained or
flown, never on import."""

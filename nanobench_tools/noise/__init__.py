"""How noisy an inertial sensor is: at rest, and in flight against motion capture."""

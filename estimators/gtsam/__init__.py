"""Smoothers of GTSAM: factor graphs over a whole flight or a window of it."""

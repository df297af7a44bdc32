"""Sources of poses while flying: simulated motion capture, the package ``motioncapture``, or a user's callable."""

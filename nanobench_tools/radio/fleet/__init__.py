"""Several vehicles at once: their plan, the distances between them, and one end for all."""

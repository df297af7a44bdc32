"""Whose clock is late against the motion capture, by how much, and how sure that is."""

"""Blind cases: recordings in which a physical effect is concealed from a simulator, with the truth sealed."""

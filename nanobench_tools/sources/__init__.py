"""Readers, one file per format; ``discover`` finds recordings by their content."""

"""Signals derived from a recording's own numbers, whatever its name or its sheet claim; each is derived once."""

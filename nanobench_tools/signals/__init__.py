"""Signals derived from a recording's numbers, independent of its name and sheet; each is derived once."""

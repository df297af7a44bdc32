"""Crazyflies over their radio protocol: a simulated one that is served, and code that flies and records real ones.

Only modules of this folder import cflib (GPL-3.0), and only those that talk to a vehicle do; ``simulated`` does not.
"""

"""Version of the package; results carry it."""

__version__ = "0.2.0.dev0"

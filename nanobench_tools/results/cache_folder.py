"""Where what can be made again is kept: recordings read, items done, compiled code."""

import os
from pathlib import Path


def cache_folder() -> Path:
    """$NANOBENCH_CACHE, else $XDG_CACHE_HOME/nanobench, else ~/.cache/nanobench."""
    if place := os.environ.get("NANOBENCH_CACHE"):
        return Path(place)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "nanobench"

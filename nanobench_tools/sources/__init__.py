"""Readers, one file per format; ``discover`` finds recordings by their content."""

from .discover import Loaded, Recording, default_data, find_recordings, load_recordings, read
from .nanobench_writer import write_nanobench

__all__ = ["Loaded", "Recording", "default_data", "find_recordings", "load_recordings", "read", "write_nanobench"]

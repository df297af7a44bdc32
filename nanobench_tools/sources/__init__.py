"""Readers, one file per format; ``discover`` finds recordings by their content.

The names below are loaded on first use, so that the small modules here (interpolation, columns) cost no pyarrow.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .discover import Loaded, Recording, default_data, find_recordings, load_recordings, read
    from .nanobench_writer import write_nanobench

__all__ = ["Loaded", "Recording", "default_data", "find_recordings", "load_recordings", "read", "write_nanobench"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = "nanobench_writer" if name == "write_nanobench" else "discover"
    return getattr(importlib.import_module(f".{module}", __name__), name)

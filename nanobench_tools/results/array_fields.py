"""Some rows of a dataclass of arrays, and several such laid end to end; other fields stay."""

from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import TypeVar

import numpy as np

T = TypeVar("T")


def rows(batch: T, keep: slice | np.ndarray) -> T:
    """Those that ``keep`` takes along the first axis of every array, those of dataclasses within it too."""
    return _each([batch], lambda parts: parts[0][keep])


def joined(batches: Sequence[T]) -> T:
    """All rows, one after the other; the rest from the first."""
    return _each(batches, np.concatenate)


def _each(batches: Sequence[T], of: Callable[[Sequence[np.ndarray]], np.ndarray]) -> T:
    found: dict[str, object] = {}
    for field in fields(batches[0]):  # type: ignore[arg-type]
        parts = [getattr(batch, field.name) for batch in batches]
        if isinstance(parts[0], np.ndarray):
            found[field.name] = of(parts)
        elif is_dataclass(parts[0]):
            found[field.name] = _each(parts, of)
    return replace(batches[0], **found)  # type: ignore[type-var]

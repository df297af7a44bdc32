"""What the Python functions hand to the steps that the verbs are made of: options, nothing printed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ..errors import UsageError
from ..flight import Flight
from ..steps.options import Options, cores

FEW = 4


def given(flights: Iterable[Flight] = (), **options: Any) -> Options:
    """Options of a verb that prints nothing, with ``flights`` as what was read: on all cores, but few flights in this
    process, which takes less than to start others."""
    read = several(flights)
    return Options(**{"jobs": cores() if len(read) > FEW else 1, "quiet": True, **options, "flights": read})


def several(flights: Flight | Iterable[Flight]) -> list[Flight]:
    """One flight or many as a list with unique names. UsageError for anything else, and for none that is a flight."""
    found = [flights] if isinstance(flights, Flight) else list(flights)
    strange = next((f for f in found if not isinstance(f, Flight)), None)
    if strange is not None:
        hint = "nb.load(path) reads flights" if isinstance(strange, (str, Path)) else "see Flight.from_pandas"
        raise UsageError(f"a {type(strange).__name__} is no Flight; {hint}")
    names = [f.name for f in found]
    twice = next((n for n in names if names.count(n) > 1), None)
    if twice is not None:
        raise UsageError(f"two flights are called {twice!r}; give each a name of its own (dataclasses.replace)")
    return found


def some(flights: Flight | Iterable[Flight]) -> list[Flight]:
    """``several``, at least one."""
    found = several(flights)
    if not found:
        raise UsageError("no flight given; nb.load(path) reads flights")
    return found


def failures(options: Options) -> Sequence[dict[str, str]]:
    """What failed on the way: [{item, file, error}]."""
    return tuple(options.failed)

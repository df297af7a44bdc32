"""All registered kinds of faults, ours and others', and their sets."""

import functools
import warnings
from collections.abc import Callable
from types import ModuleType

from ...lookup.registry import load_all
from .kind import FaultKind


@functools.cache
def kinds() -> dict[str, FaultKind]:
    """Name -> kind, sorted. An entry point of ``nanobench.faults`` is a FaultKind, or a module with a ``FAULT``. Others
    are left out with a warning."""
    found = {}
    for name, entry in load_all("faults").items():
        kind = getattr(entry, "FAULT", None) if isinstance(entry, ModuleType) else entry
        if isinstance(kind, FaultKind) and kind.name == name:
            found[name] = kind
        else:
            problem = f"is called {kind.name!r}" if isinstance(kind, FaultKind) else "is no FaultKind and has no FAULT"
            warnings.warn(f"faults plug-in {name!r} left out: it {problem}", stacklevel=2)
    return found


def those(chosen: Callable[[FaultKind], bool | None]) -> frozenset[str]:
    """Names of the kinds of which ``asked(kind)`` is true."""
    return frozenset(name for name, kind in kinds().items() if chosen(kind))


def cutting() -> frozenset[str]:
    """Kinds whose span must not be used. The clock kinds are corrected instead. A missing column removes no time (its
    users get an InputError that names it). The protocols drop a copy as a whole. The rest is information."""
    return those(lambda kind: kind.cuts)


def cutting_logs() -> frozenset[str]:
    """Faults of logging, cut from every protocol but the published one. Jumps and resets of an estimate are its errors
    and are scored. Of the motion capture, which is the truth, every cutting fault is cut."""
    return those(lambda kind: kind.cuts if kind.cuts_logs is None else kind.cuts_logs)


def cutting_trim() -> frozenset[str]:
    """Kinds in whose span the mean of motor commands is no trim."""
    return those(lambda kind: kind.cuts if kind.cuts_trim is None else kind.cuts_trim)


def log_ended() -> frozenset[str]:
    """Kinds that say that the log of a stream ended before its recording."""
    return those(lambda kind: kind.log_ended)


def group_of(name: str) -> str:
    """``lost`` | ``value`` | ``clock`` | ``flight`` | ``information``. The last one is also that of an unknown kind."""
    kind = kinds().get(name)
    return kind.group if kind else "information"

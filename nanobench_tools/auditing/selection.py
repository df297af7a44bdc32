"""Which recordings count: copies and pieces of others are found by content, so that no flight is counted twice."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..flight import Flight
from .faults.copy import fingerprint

SAME_STAMP_S = 1e-4
"""Formats round timestamps to four digits at least; rows are at least 1e-3 s apart."""
DIGITS = range(3, 9)
"""Digits to which formats round positions in m."""


@dataclass(frozen=True)
class Repeat:
    """A recording left out: every row of it is a row of ``of``; ``kind`` is ``copy`` or ``slice``."""

    flight: Flight
    of: Flight
    kind: str


def distinct(flights: Sequence[Flight]) -> tuple[list[Flight], list[Repeat]]:
    """(recordings that count, in the order given; those left out).

    A recording is left out when its motion capture rows are a run of rows of a longer (or equal) one. They have the
    same absolute timestamps and the same positions. Without motion capture, every number is the same. Of equal ones
    the first in order of content and path is kept, in any given order.
    """
    order = sorted(range(len(flights)), key=lambda i: (-len(_rows(flights[i])[0]), flights[i].epoch_s,
                                                       flights[i].provenance.path))
    first = _first_equal(flights, order)
    kept: list[int] = []
    repeats: dict[int, Repeat] = {}
    for i in order:
        whole = first.get(i) if i in first else next((k for k in kept if is_piece(flights[i], flights[k])), None)
        if whole is None:
            kept.append(i)
        else:
            same = len(_rows(flights[i])[0]) == len(_rows(flights[whole])[0])
            repeats[i] = Repeat(flights[i], flights[whole], "copy" if same else "slice")
    return [flights[i] for i in sorted(kept)], [repeats[i] for i in sorted(repeats)]


def without_copies(flights: Sequence[Flight]) -> tuple[list[Flight], list[Repeat]]:
    """As ``distinct``, but pieces of longer recordings stay; only recordings equal to another are left out."""
    kept: list[Flight] = []
    repeats: list[Repeat] = []
    order = sorted(range(len(flights)), key=lambda i: flights[i].provenance.path)
    first = _first_equal(flights, order)
    for i in order:
        flight, rows = flights[i], len(_rows(flights[i])[0])
        same = flights[first[i]] if i in first else next(
            (k for k in kept if len(_rows(k)[0]) == rows and is_piece(flight, k)), None)
        if same is None:
            kept.append(flight)
        else:
            repeats.append(Repeat(flight, same, "copy"))
    return [f for f in flights if any(f is k for k in kept)], repeats


def _first_equal(flights: Sequence[Flight], order: Sequence[int]) -> dict[int, int]:
    """Recordings without motion capture that equal an earlier one in ``order`` -> that one."""
    seen: dict[str, int] = {}
    first = {i: seen.setdefault(fingerprint(flights[i]), i) for i in order if not len(_rows(flights[i])[0])}
    return {i: k for i, k in first.items() if k != i}


def is_piece(part: Flight, whole: Flight) -> bool:
    """Whether all motion capture rows of ``part`` are consecutive rows of ``whole`` (equal recordings included)."""
    time_p, position_p = _rows(part)
    time_w, position_w = _rows(whole)
    if not 0 < len(time_p) <= len(time_w):
        return False
    first = int(np.searchsorted(time_w, time_p[0] - SAME_STAMP_S))
    if first + len(time_p) > len(time_w) or abs(time_w[first] - time_p[0]) > SAME_STAMP_S:
        return False
    rows = slice(first, first + len(time_p))
    return (bool(np.all(np.abs(time_w[rows] - time_p) <= SAME_STAMP_S))
            and _same(position_p, position_w[rows]))


def overlap(a: Flight, b: Flight) -> bool:
    """Whether the motion capture rows of both are the same ones (two or more) all through the time both cover."""
    rows = []
    (time_a, position_a), (time_b, position_b) = _rows(a), _rows(b)
    if not len(time_a) or not len(time_b):
        return False
    start, end = max(time_a[0], time_b[0]) - SAME_STAMP_S, min(time_a[-1], time_b[-1]) + SAME_STAMP_S
    for time_s, position in ((time_a, position_a), (time_b, position_b)):
        common = (time_s >= start) & (time_s <= end)
        rows.append((time_s[common], position[common]))
    (time_a, position_a), (time_b, position_b) = rows
    return (len(time_a) == len(time_b) > 1 and bool(np.all(np.abs(time_a - time_b) <= SAME_STAMP_S))
            and _same(position_a, position_b))


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether all positions (n, 3) are the same, to the digits of those that were rounded more."""
    if np.array_equal(a, b, equal_nan=True):
        return True
    digits = next((d for d in DIGITS for v in (a, b) if np.array_equal(np.round(v, d), v, equal_nan=True)), None)
    return digits is not None and np.allclose(a, b, rtol=0.0, atol=0.51 * 10.0**-digits, equal_nan=True)


def apart(train: Sequence[Flight], test: Sequence[Flight]) -> tuple[list[Flight], dict[str, str]]:
    """(test recordings that share nothing with a training one; reason by name of the others).

    Shared are rows at the same time of day, or all numbers at any time of day. Order, names and file hashes do not
    matter.
    """
    known = {fingerprint(flight): flight for flight in train}
    kept, reasons = [], {}
    for flight in test:
        same = known.get(fingerprint(flight))
        shared = next((f for f in train if overlap(flight, f)), None)
        if same is not None:
            reasons[flight.name] = f"copy of {same.name}, which trains"
        elif shared is not None:
            reasons[flight.name] = f"shares rows with {shared.name}, which trains"
        else:
            kept.append(flight)
    return kept, reasons


def _rows(flight: Flight) -> tuple[np.ndarray, np.ndarray]:
    """(absolute timestamps (n,), positions (n, 3)) of motion capture; empty without its positions."""
    if "mocap" not in flight or not all(name in flight["mocap"] for name in ("px", "py", "pz")):
        return np.empty(0), np.empty((0, 3))
    mocap = flight["mocap"]
    return flight.epoch_s + mocap.time_s, mocap["px", "py", "pz"]

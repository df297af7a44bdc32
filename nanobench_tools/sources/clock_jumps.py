"""Rows whose timestamps lie an hour and more away from most others: a damaged timestamp, another clock, or another
recording in the same file. A few are left out, and the rest is one recording; many are refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..flight import Flight
from .base import text_fault

PAUSE_S = 3600.0
"""Longer than the battery of a small multirotor lasts: rows further apart are not of one flight."""
FEW, FEW_ROWS = 0.01, 2
"""Share and number of rows up to which these are damaged timestamps, or messages that a bag repeats from before."""


def far_rows(time_s: np.ndarray) -> np.ndarray:
    """(n,) bool: rows that a step of more than ``PAUSE_S`` separates from most others."""
    far = np.zeros(len(time_s), dtype=bool)
    order = np.argsort(time_s)
    order = order[np.isfinite(time_s[order])]
    parts = np.split(order, np.flatnonzero(np.diff(time_s[order]) > PAUSE_S) + 1)
    largest = max(range(len(parts)), key=lambda k: len(parts[k]))
    for k, part in enumerate(parts):
        far[part] = k != largest
    return far


def many_far_rows(time_s: np.ndarray, far: np.ndarray, place: str) -> InputError | None:
    """The error for timestamps of several recordings or clocks; None where the rows that are ``far`` are few."""
    if far.sum() <= max(FEW * len(time_s), FEW_ROWS):
        return None
    known = np.flatnonzero(np.isfinite(time_s))
    steps = np.diff(time_s[known])
    at = int(np.argmax(np.abs(steps)))
    return InputError(place, f"timestamps step by {steps[at]:.4g} s at row {known[at + 1] + 1}; {far.sum()} rows lie "
                      "an hour and more from the others", "write each recording to a separate file, or give another "
                      "unit of time")


def on_one_clock(flight: Flight) -> Flight:
    """The flight without the few rows that lie far away in time, with a finding. InputError where they are many."""
    far = {name: far_rows(stream.time_s) for name, stream in flight.streams.items() if len(stream)}
    if not any(rows.any() for rows in far.values()):
        return flight
    streams, findings = dict(flight.streams), list(flight.provenance.findings)
    for name, rows in far.items():
        stream = streams[name]
        if (error := many_far_rows(stream.time_s, rows, f"{flight.provenance.path}: {name}")) is not None:
            raise error
        streams[name] = stream.rows(~rows)
    zero = min(float(stream.time_s[0]) for stream in streams.values() if len(stream))
    counted: dict[tuple[int, float], list[str]] = {}
    for name, rows in far.items():
        if rows.any():
            away = float(np.nanmax(np.abs(flight.streams[name].time_s[rows] - zero)))
            counted.setdefault((int(rows.sum()), away), []).append(name)
    for (count, away), names in counted.items():  # streams of one table lose the same rows
        findings.append(text_fault("bad_cell", names[0] if len(names) == 1 else "", (),
                                   f"{count} rows of {', '.join(names)} are stamped up to {away:.4g} s away from all "
                                   "others: left out", (0.0, float(streams[names[0]].time_s[-1]) - zero), float(count),
                                   "rows"))
    return replace(
        flight, streams={name: replace(stream, time_s=stream.time_s - zero) for name, stream in streams.items()},
        epoch_s=flight.epoch_s + zero, provenance=replace(flight.provenance, findings=tuple(findings)))

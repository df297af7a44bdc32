"""Rows in which a tracker writes a placeholder because it does not see the body: zeros, the identity, a number far
outside. They are read as missing, so that they are an occlusion and no jump to the origin and back. Zeros or the
identity as rotation in every row of a path that moves are placeholders, too: no attitude was sent.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .. import so3
from ..flight import Fault, Flight, Stream
from ..settings import number

POSITION, ROTATION = ("px", "py", "pz"), ("qx", "qy", "qz", "qw")
APART_M = number("sources.lost_poses.apart_m")
"""A placeholder is at least so far from the poses on either side, plus STEPS usual steps between rows."""
STEPS = number("sources.lost_poses.steps")
APART_RAD = number("sources.lost_poses.apart_rad")
"""The same of an identity rotation."""
FEWEST_ROWS = 100
"""Of one and the same rotation, to be called a placeholder: a convention."""


def without_placeholders(flight: Flight) -> Flight:
    """The flight with NaN in place of placeholders in its motion capture, and a note. With a finding where no attitude
    was sent, and without an attitude of zeros. The flight itself without either."""
    flight = _without_unsent_attitude(flight)
    stream = flight.streams.get("mocap")
    if stream is None or not len(rows := np.flatnonzero(placeholders(stream))):
        return flight
    values = stream.values.copy()
    values[rows] = np.nan
    note = (f"mocap: {len(rows)} rows hold no pose but a placeholder (the first at {stream.time_s[rows[0]]:.3f} s): "
            "read as missing")
    return replace(flight.with_streams(mocap=replace(stream, values=values)),
                   provenance=replace(flight.provenance, notes=(*flight.provenance.notes, note)))


def _without_unsent_attitude(flight: Flight) -> Flight:
    stream = flight.streams.get("mocap")
    if stream is None or len(stream) < FEWEST_ROWS or not all(q in stream for q in (*POSITION, *ROTATION)):
        return flight
    turn, position = stream[ROTATION], stream[POSITION]
    turn, there = turn[np.isfinite(turn).all(axis=1)], position[np.isfinite(position).all(axis=1)]
    if len(turn) < FEWEST_ROWS or len(there) < 2 or np.ptp(turn, axis=0).any() or np.ptp(there, axis=0).max() < APART_M:
        return flight
    if np.count_nonzero(turn[0]) > 1 or turn[0, 1:3].any():
        return flight
    columns = tuple(stream.columns[stream.index(q)] for q in ROTATION)
    value = ", ".join(f"{v:g}" for v in turn[0])
    evidence = f"the attitude is {value} in every row while the position moves: none was sent"
    finding = Fault("missing_column", "mocap", columns, float(stream.time_s[0]), float(stream.time_s[-1]), 4.0,
                    "columns", evidence + ("; left out" if not turn[0].any() else "; its errors mean nothing"))
    if finding in flight.provenance.findings:
        return flight
    if not turn[0].any():
        kept = [k for k, q in enumerate(stream.quantities) if q not in ROTATION]
        flight = flight.with_streams(mocap=replace(
            stream, values=stream.values[:, kept], columns=tuple(stream.columns[k] for k in kept),
            quantities=tuple(stream.quantities[k] for k in kept), unit=tuple(stream.unit[k] for k in kept)))
    return replace(flight, provenance=replace(flight.provenance, findings=(*flight.provenance.findings, finding)))


def placeholders(stream: Stream) -> np.ndarray:
    """(n,) bool: rows of a pose stream that hold a placeholder.

    A placeholder is one of three:

    - a position of zeros that is apart from the poses on either side;
    - another position that repeats exactly while the poses before and after are nearer to each other than to it;
    - an identity rotation that is apart from those on either side.

    """
    lost = np.zeros(len(stream), dtype=bool)
    if len(stream) < 3 or not all(q in stream for q in POSITION):
        return lost
    position = stream[POSITION]
    with np.errstate(invalid="ignore"):
        step = np.linalg.norm(np.diff(position, axis=0), axis=1)
    moving = step[np.isfinite(step) & (step > 0.0)]
    limit = APART_M + STEPS * (float(np.median(moving)) if len(moving) else 0.0)
    for a, b in _constant(position, np.logical_not(position.any(axis=1))):
        beside = position[_beside(position, a, b)]
        away = np.linalg.norm(beside - position[a], axis=1)
        lost[a:b] = len(away) > 0 and away.min() > limit and (
            not position[a].any() or (len(away) == 2 and np.linalg.norm(beside[1] - beside[0]) < 0.5 * away.min()))
    if all(q in stream for q in ROTATION):
        turn = stream[ROTATION]
        identity = (np.count_nonzero(turn, axis=1) == 1) & turn[:, [0, 3]].any(axis=1)
        for a, b in _constant(turn, np.zeros(len(turn), dtype=bool)):
            if identity[a]:
                away = so3.geodesic_angle(turn[_beside(turn, a, b)], turn[a])
                lost[a:b] |= len(away) > 0 and away.min() > APART_RAD
    return lost


def _constant(values: np.ndarray, alone: np.ndarray) -> np.ndarray:
    """(m, 2) first and one-past-last row of every run of two or more equal, finite rows; of one, where ``alone``."""
    finite = np.isfinite(values).all(axis=1)
    new = np.ones(len(values), dtype=bool)
    new[1:] = (values[1:] != values[:-1]).any(axis=1)
    first = np.flatnonzero(new)
    end = np.append(first[1:], len(values))
    kept = finite[first] & ((end - first > 1) | alone[first])
    return np.stack([first[kept], end[kept]], axis=1)


def _beside(values: np.ndarray, first: int, end: int) -> list[int]:
    """The nearest rows on either side of [first, end) that hold numbers other than zeros."""
    real = np.flatnonzero(np.isfinite(values).all(axis=1) & values.any(axis=1))
    before, after = np.searchsorted(real, first) - 1, np.searchsorted(real, end)
    return [int(real[k]) for k in (before, after) if 0 <= k < len(real)]

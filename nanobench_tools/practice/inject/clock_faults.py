"""Faults of time: timestamps twice or backwards, and a vehicle's clock that is late, drifts or wanders.

The rows stay on the timestamps of the motion capture, as in the files: the values are moved along time instead.
"""

from dataclasses import replace

import numpy as np

from ...auditing.faults.kind import Blind, Injection
from ...flight import Fault, Flight
from ..clock import ClockError, draw_clock
from .place import choose_time, several, truth, with_values


def _restamped(flight: Flight, rng_clock: ClockError, stream: str) -> Flight:
    """Every stream meant by ``stream`` as if its packets had got the timestamps of this clock."""
    for name in several(flight, stream):
        s = flight[name]
        stamps = rng_clock.stamp(s.time_s)
        values = np.stack([np.interp(s.time_s, stamps, column) for column in s.values.T], axis=1)
        flight = flight.with_streams(**{name: with_values(s, values)})
    return flight


def clock_offset(flight: Flight, rng: np.random.Generator, size: float = 0.05, *,
                 stream: str = "") -> tuple[Flight, Fault]:
    """The vehicle's timestamps (or one stream's) are ``size`` s late."""
    span = flight.span
    return (_restamped(flight, ClockError(size), stream),
            truth("clock_offset", stream, (), (span.start_s, span.end_s), size, "s", "timestamps late by a constant"))


def clock_drift(flight: Flight, rng: np.random.Generator, size: float = 0.002, *,
                 stream: str = "") -> tuple[Flight, Fault]:
    """The vehicle's clock gains ``size`` s per s; the timestamps are right in the middle of the recording."""
    span = flight.span
    middle = 0.5 * (span.start_s + span.end_s)
    return (_restamped(flight, ClockError(-size * middle, size), stream),
            truth("clock_drift", stream, (), (span.start_s, span.end_s), size, "s/s", "timestamps later and later"))


def clock_wander(flight: Flight, rng: np.random.Generator, size: float = 0.03, *,
                 stream: str = "") -> tuple[Flight, Fault]:
    """The vehicle's timestamps are late by a sawtooth of standard deviation ``size`` s and mean zero."""
    span = flight.span
    return (_restamped(flight, draw_clock(rng, span.end_s, wander_sd_s=size), stream),
            truth("clock_wander", stream, (), (span.start_s, span.end_s), size, "s", "timestamps late by a sawtooth"))


def _with_stamps(flight: Flight, time_s: np.ndarray) -> Flight:
    """Replace the timestamps of all streams that share those of the motion capture."""
    old = flight["mocap"].time_s
    return flight.with_streams(**{name: replace(s, time_s=time_s) for name, s in flight.streams.items()
                                  if len(s) == len(old) and np.array_equal(s.time_s, old)})


def duplicate_time(flight: Flight, rng: np.random.Generator, size: float = 3, *, at_s: float | None = None
                   ) -> tuple[Flight, Fault]:
    """``size`` rows in a row get the timestamp of the row before them."""
    t = flight["mocap"].time_s.copy()
    i = max(int(np.searchsorted(t, choose_time(flight, rng, at_s))), 1)
    rows = slice(i, i + int(size))
    span = float(t[i - 1]), float(t[rows][-1])
    t[rows] = t[i - 1]
    return _with_stamps(flight, t), truth("duplicate_time", "", (), span, int(size), "rows", "timestamps repeated")


def coarse_time(flight: Flight, rng: np.random.Generator, size: float = 0.1) -> tuple[Flight, Fault]:
    """Timestamps rounded down to ``size`` s; the truth's size is the rows that then share one."""
    t = flight["mocap"].time_s
    coarse = np.floor(t / size) * size
    span = float(coarse[0]), float(coarse[-1])
    shared = float(np.median(np.unique(coarse, return_counts=True)[1]))
    return _with_stamps(flight, coarse), truth("coarse_time", "", (), span, shared, "rows", "timestamps rounded")


def no_common_time(flight: Flight, rng: np.random.Generator, size: float = 1.7e9, *, stream: str = "imu"
                   ) -> tuple[Flight, Fault]:
    """The timestamps of one stream count from a moment ``size`` s later than those of the others."""
    moved = flight[stream]
    span = flight.span
    return (flight.with_streams(**{stream: replace(moved, time_s=moved.time_s - size)}),
            truth("no_common_time", "", (), (span.start_s - size, span.end_s), size, "s", "another epoch"))


def backward_time(flight: Flight, rng: np.random.Generator, size: float = 0.2, *, at_s: float | None = None
                  ) -> tuple[Flight, Fault]:
    """From a row on, the timestamps go on from ``size`` s before the row ahead of it."""
    t = flight["mocap"].time_s.copy()
    i = max(int(np.searchsorted(t, choose_time(flight, rng, at_s))), 1)
    t[i:] -= t[i] - (t[i - 1] - size)
    return (_with_stamps(flight, t),
            truth("backward_time", "", (), (float(t[i]), float(t[i - 1])), size, "s", "timestamps step back"))


DUPLICATE_TIME = Injection(duplicate_time, (1, 3, 20), "rows")
COARSE_TIME = Injection(coarse_time, (0.05, 0.1, 1.0), "s")
NO_COMMON_TIME = Injection(no_common_time, (300.0, 1.7e9), "s", ({}, {"stream": "motor"}))
BACKWARD_TIME = Injection(backward_time, (0.005, 0.05, 1.0), "s")
CLOCK_OFFSET = Injection(clock_offset, (-0.1, -0.03, 0.01, 0.05, 0.1), "s",
                         blind=(Blind(0.05, {}, True, place=5), Blind(0.1, {}, True, place=6)))
CLOCK_DRIFT = Injection(clock_drift, (-0.003, 0.001, 0.005), "s/s", blind=(Blind(0.005, {}, True, place=13),))
CLOCK_WANDER = Injection(clock_wander, (0.01, 0.03, 0.06), "s")

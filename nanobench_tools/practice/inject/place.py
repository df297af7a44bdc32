"""Where an injected fault goes: which rows, which stream, and the sentence that says so."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...errors import UsageError
from ...flight import Fault, Flight, Stream

FIRMWARE = ("imu", "motor", "estimator", "estimator_acc", "attitude", "attitude_qw", "setpoint", "pid", "battery")
"""Streams of the vehicle, which share one radio and one clock."""
NOISY = ("imu", "estimator", "estimator_acc", "attitude", "attitude_qw")
"""Streams that never stand still by themselves."""
LIFTED_M = 0.3
TAIL_S = 0.5
"""The end of a recording in which the streams may be a continued line already; nothing is injected there."""


def in_the_air(flight: Flight) -> tuple[float, float]:
    """First and last time at which the mocap height is 0.3 m above its start; the whole recording if it never is."""
    mocap = flight["mocap"]
    up = np.flatnonzero(mocap["pz"] > mocap["pz"][0] + LIFTED_M)
    if len(up) < 2:
        return float(mocap.time_s[0]), float(mocap.time_s[-1]) - TAIL_S
    return float(mocap.time_s[up[0]]), float(mocap.time_s[up[-1]])


def choose_time(flight: Flight, rng: np.random.Generator, at_s: float | None, lasts_s: float = 0.0) -> float:
    """``at_s``, or a time in the air such that ``lasts_s`` more lies in it too (as far as it can)."""
    if at_s is not None:
        return float(at_s)
    low, high = in_the_air(flight)
    margin = 0.1 * (high - low)
    return float(rng.uniform(low + margin, max(high - margin - lasts_s, low + margin + 0.01)))


def choose(rng: np.random.Generator, given: str | None, names: Sequence[str], flight: Flight) -> str:
    """``given``, or one of ``names`` that the flight has. Raises UsageError when it has none."""
    if given is not None:
        return given
    here = [name for name in names if name in flight]
    if not here:
        raise UsageError(f"{flight.name} has none of the streams {', '.join(names)}")
    return here[int(rng.integers(len(here)))]


def several(flight: Flight, stream: str) -> list[str]:
    """The streams meant by ``stream``: itself, or all of the vehicle's for the empty name."""
    return [stream] if stream else [name for name in FIRMWARE if name in flight]


def with_values(stream: Stream, values: np.ndarray) -> Stream:
    return replace(stream, values=values)


def truth(kind: str, stream: str, columns: Sequence[str], span: tuple[float, float], size: float, unit: str,
          what: str) -> Fault:
    """The injected change, as a Fault."""
    return Fault(kind, stream, tuple(columns), float(span[0]), float(span[1]), float(size), unit, f"injected: {what}")

"""What a case is made from: flights, a vehicle, what is concealed, what is innocent, what is wrong with the data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from nanobench_tools.auditing.faults.kinds import those
from nanobench_tools.practice.references import PathSpec
from nanobench_tools.sources.nanobench_columns import STREAMS

from .airframe import Airframe
from .truth import TrueFault

OUTCOMES = {"null": "none", "single": "named", "twin": "named", "pair": "named", "change": "named",
            "fault": "data_fault", "foreign": "unknown"}
"""Kind of a case -> the outcome a diagnosis should come to.


- null: the simulator is right.
- single: one effect concealed; twin: one of a group that is easily confused, on flights that separate it; pair: two at
  once.
- change: an effect in some flights only.
- fault: the simulator is right and the data are wrong; "none" is the right answer unless the fault forbids one
  (``forbids``).
- foreign: an effect that no term describes.
"""
COMPARED = {"mocap": ("px", "py", "pz", "qx", "qy", "qz", "qw"), "imu": ("gyro_x", "gyro_y", "gyro_z"),
            "motor": ("m1", "m2", "m3", "m4")}
"""What a recording has to hold for its physics to be compared with a simulator's."""


def forbids(faults: Sequence[TrueFault], flights: Sequence[str]) -> bool:
    """Whether faults leave nothing to compare: every flight has one of what is compared, from its first
    row to its last. One that is over after some seconds, or in one flight, leaves the rest."""
    whole = those(lambda kind: kind.whole and kind.cuts)  # a clock is, too, but the motion capture shows it: put right
    spoilt = {f.flight for f in faults if f.kind in whole
              and f.stream in COMPARED and not {*f.columns}.isdisjoint(_named(f.stream))}
    return spoilt >= {*flights}


def _named(stream: str) -> set[str]:
    """Quantities and NanoBench columns of what is compared of a stream."""
    return {name for c in STREAMS[stream] if c.quantity in COMPARED[stream] for name in (c.quantity, c.name)}


@dataclass(frozen=True)
class Hidden:
    """An effect and its parameters (``Effect.draw``); ``flights`` are numbers of those it acts in, None means all."""

    effect: str
    size: str
    parameters: Mapping[str, Any]
    flights: tuple[int, ...] | None = None


@dataclass(frozen=True)
class DataFault:
    """``nanobench_tools.practice.inject`` kind with its size and options, in flights of these numbers."""

    kind: str
    size: float | None
    options: Mapping[str, Any]
    flights: tuple[int, ...]


@dataclass(frozen=True)
class FlightSpec:
    """Where to fly behind which onboard controller (``pid`` | ``mellinger``), with how much charge (share) at start."""

    path: PathSpec
    controller: str
    charge: float


@dataclass(frozen=True)
class Nuisance:
    """Variations that are never physics. ``disturbance_m_s2``: standard deviation of the air's force (correlated over
    0.5 s); ``thrust_noise``: flicker of each motor (0.05 s); clock_wander_s and clock_offset_s of the telemetry;
    ``loss``: lowest and highest share of packets lost; ``battery_period_s``: one voltage in this time, as recorded, or
    every 10 ms; ``imu_tilt_rad``: rotation vector from the vehicle to the frame of the logged IMU."""

    disturbance_m_s2: float = 0.04
    thrust_noise: float = 0.003
    clock_wander_s: float = 0.0
    clock_offset_s: float = 0.0
    loss: tuple[float, float] = (0.03, 0.15)
    lost_frames: float = 2.0
    battery_period_s: float = 0.11
    imu_tilt_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class CaseSpec:
    """All that determines a case; the same spec gives the same recordings, alone or with others.

    ``seed`` and ``index`` feed the random numbers of the flights. ``airframe`` is what the simulator believes;
    ``concealed`` effects are missing from it; ``known`` ones are in it with their true values. ``note`` says in words
    what is special.
    """

    name: str
    kind: str
    seed: int
    index: int
    airframe: Airframe
    flights: tuple[FlightSpec, ...]
    concealed: tuple[Hidden, ...] = ()
    known: tuple[Hidden, ...] = ()
    faults: tuple[DataFault, ...] = ()
    nuisance: Nuisance = field(default_factory=Nuisance)
    engine: str = "practice"
    note: str = ""

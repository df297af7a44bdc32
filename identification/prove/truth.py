"""Truth of a blind case, to be compared with a verdict; sealed and kept as JSON until all verdicts exist."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from nanobench_tools.results.result import Result


@dataclass(frozen=True, repr=False)
class TrueParameter(Result):
    """believed: what the simulator says, None where it lacks the parameter."""

    value: float
    unit: str
    believed: float | None


@dataclass(frozen=True, repr=False)
class TrueEffect(Result):
    """What acts. ``foreign``: no term says it; ``twins``: terms that free flight cannot distinguish from it;
    parameters by flat name; ``drawn``: as the effect itself has them; ``flights``: names of those it acts in;
    ``meaning``: of the size, in words."""

    term: str
    size: str
    flights: tuple[str, ...]
    foreign: bool = False
    twins: tuple[str, ...] = ()
    parameters: Mapping[str, TrueParameter] = field(default_factory=dict)
    meaning: str = ""
    drawn: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, repr=False)
class TrueFault(Result):
    """Fault of the data of one flight; times from its first row, None for a fault that was not injected."""

    flight: str
    kind: str
    stream: str = ""
    columns: tuple[str, ...] = ()
    start_s: float | None = None
    end_s: float | None = None
    size: float | None = None
    unit: str = ""


@dataclass(frozen=True, repr=False)
class Truth(Result):
    """effects that are concealed; ``known``: names of effects the simulator has right; faults of the data; ``outcome``:
    that of a right verdict on a fault; engine that flew, and the one wanted; ``corrected``: simulator.toml of the
    simulator that knows; ``tumbled``: names of flights that fell; ``nuisance``: variations that are not physics, with
    their units."""

    case: str
    kind: str
    effects: tuple[TrueEffect, ...] = ()
    faults: tuple[TrueFault, ...] = ()
    outcome: str | None = None
    engine: str | None = None
    note: str = ""
    known: tuple[str, ...] = ()
    corrected: str = ""
    tumbled: tuple[str, ...] = ()
    nuisance: Mapping[str, object] = field(default_factory=dict)
    engine_wanted: str | None = None

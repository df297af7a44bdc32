"""Rows of Task 3, and the scores of single flights and windows that they are made from; what tasks share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..metrics.statistics import Summary
from ..results.result import INLINE, OPTIONAL, Result, named
from .published import Published
from .sessions import Drawn

Metrics = Mapping[str, float | None]
"""Scores of one flight by metric, whose ending is the unit; None or nan where one is not defined."""


@dataclass(frozen=True, repr=False)
class Scored(Result):
    """One estimator on one recording: over so many ``rows``; ``dropped`` counts timestamps without truth; trajectory
    (k, 8) the scored rows: t [s from the first row], position [m], quaternion (None: written elsewhere);
    ``convention``: how a trajectory file differs from ours, a sentence, or ""."""

    metrics: Metrics
    rows: int
    dropped: int
    trajectory: np.ndarray | None = None
    convention: str = ""


@dataclass(frozen=True, repr=False)
class EndError(Result):
    """h_s after the last pose at t0_s: the position end_m (3,) said, its error, and drift in per cent of the path flown
    since. ``nees``: squared error over the stated covariance, 3 on average. ``inside_3_sigma``: whether that is as
    small as for 99.73 % of Gaussian errors. Both None where no covariance is stated."""

    t0_s: float
    h_s: float
    end_m: Sequence[float]
    error_m: float
    horizontal_m: float
    vertical_m: float
    drift_percent: float
    inside_3_sigma: bool | None
    nees: float | None = field(default=None, metadata=OPTIONAL)


@dataclass(frozen=True, repr=False)
class BlackoutScore(Result):
    """Of one estimator on one flight; ``metrics`` are means over its windows."""

    windows: list[EndError]
    metrics: Metrics


@dataclass(frozen=True, repr=False)
class Spread(Result):
    """Over n windows."""

    n: int
    median: float
    p90: float


@dataclass(frozen=True, repr=False)
class Ratios(Result):
    """Errors over those of the row ``to``, by metric, in Task 1 by horizon too, with their intervals."""

    ratio: Mapping[str, Any]
    ci95: Mapping[str, Any] = field(metadata=named("ratio_ci95"))
    to: str = field(metadata=named("ratio_to"))


@dataclass(frozen=True, repr=False)
class ClockRatios(Ratios):
    """The same over those of the same method on the clock ``to``."""

    ratio: Mapping[str, Any] = field(metadata=named("clock_ratio"))
    ci95: Mapping[str, Any] = field(metadata=named("clock_ratio_ci95"))
    to: str = field(metadata=named("clock_ratio_to"))


@dataclass(frozen=True, repr=False, kw_only=True)
class EstimateRow(Result):
    """One method over the n flights of one group.

    Attributes
    ----------
    protocol, method : str
        As for ``nanobench estimate``.
    causal : bool or None
        Whether an estimate at t uses only data up to t; null if unknown.
    group : str
        ``all``, or what its flights have in common, such as their speed.
    n : int
        Number of flights.
    flights : list of str
        Their names.
    n_windows : mapping
        Of blackouts: number of windows by their length.
    given : str
        Inputs of the method, in words.
    inputs : str
        The same in short; equal for methods that may be ranked against each other.
    over_windows : mapping
        Of blackouts: median and 90th percentile over windows, by metric.
    dropped_stamps : int
        Estimates without a pose of the motion capture near their time.
    drawn : Drawn
        Basis of the intervals: number of sessions, design effects, and why an interval is missing or too narrow.
    metrics : mapping
        Statistics over flights by metric, whose name ends in its unit. Of blackouts, each flight counts with its mean.
    published : Published
        The published row for comparison.
    aiding : mapping
        How poses came: rate, delay, noise and loss.
    clock : str
        ``as-recorded``, ``offset`` or ``retimed``.
    clock_evidence : list of str
        Streams that set the clock.
    n_moving : int
        Number of flights whose clock has a moving error.
    clock_evidence_attitude : list of str
        Streams that set the clock for attitudes, where these are others.
    ratios : Ratios
        Errors over those of another method on the same flights.
    clock_ratios : ClockRatios
        Errors over those of the same method on another clock.
    """

    protocol: str
    method: str
    causal: bool | None
    group: str
    n: int
    flights: Sequence[str]
    n_windows: Mapping[str, int] | None = field(default=None, metadata=OPTIONAL)
    given: str
    inputs: str
    over_windows: Mapping[str, Spread] | None = field(default=None, metadata=OPTIONAL)
    dropped_stamps: int | None = field(default=None, metadata=OPTIONAL)
    drawn: Drawn = field(metadata=INLINE)
    metrics: Mapping[str, Summary]
    published: Published | None = field(default=None, metadata=INLINE)
    aiding: Mapping[str, float] = field(default_factory=dict, metadata=INLINE)
    clock: str = field(default="", metadata=OPTIONAL)
    clock_evidence: Sequence[str] | None = field(default=None, metadata=OPTIONAL)
    n_moving: int | None = field(default=None, metadata=OPTIONAL)
    clock_evidence_attitude: Sequence[str] | None = field(default=None, metadata=OPTIONAL)
    ratios: Ratios | None = field(default=None, metadata=INLINE)
    clock_ratios: ClockRatios | None = field(default=None, metadata=INLINE)


@dataclass(frozen=True, repr=False)
class FlightScore(Result):
    """One method on one flight and clock; aiding: how poses came."""

    protocol: str
    method: str
    flight: str
    speed: str | None
    clock: str
    aiding: Mapping[str, float] = field(metadata=INLINE)
    metrics: Metrics


@dataclass(frozen=True, repr=False)
class WindowScore(Result):
    """One window of one flight, method and clock."""

    flight: str
    method: str
    clock: str
    end: EndError = field(metadata=INLINE)


@dataclass(frozen=True, repr=False)
class Answer(Result):
    """A predictor's change after a step of PWM, and that of rigid-body physics, in ``unit``."""

    answer: float
    physics: float
    unit: str


@dataclass(frozen=True, repr=False)
class AxisAnswer(Result):
    """About one axis.

    - sign: ``right``, ``wrong`` or ``none``; ratio: to the physics.
    - answers: by seconds after the step.
    - right_share: of the windows whose own response has the right sign."""

    sign: str
    ratio: float
    after_s: dict[str, Answer]
    right_share: float


@dataclass(frozen=True, repr=False)
class CommandResponse(Result):
    """Over so many windows, to a ``step`` of PWM; vehicle: a sentence, empty for one whose signs are all right."""

    roll: AxisAnswer
    pitch: AxisAnswer
    yaw: AxisAnswer
    thrust: AxisAnswer
    windows: int
    step: float
    vehicle: str

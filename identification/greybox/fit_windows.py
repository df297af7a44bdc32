"""Windows of flights as a fit needs them: starts, inputs, and what came."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.auditing.verb_needs import SYSID
from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.flight import Flight
from nanobench_tools.methods import Past, Prediction, Windows
from nanobench_tools.metrics.prediction import multi_horizon, window_errors
from nanobench_tools.protocols.task1 import Case, training_cases
from nanobench_tools.protocols.windows import cut_windows
from nanobench_tools.results import array_fields
from nanobench_tools.settings import count, number

from .arrays import FitWindows
from .fitted_predictor import past_inputs, start_of

T = TypeVar("T", Windows, Past, Prediction)

STILL = number("greybox.fit_windows.still")
MOST_WINDOWS = count("greybox.fit_windows.most_windows")


@dataclass(frozen=True)
class Cut:
    """Every ``thin``-th window of one flight, and what came."""

    name: str
    windows: Windows
    came: Prediction
    thin: int = 1


def cases_of(flights: Sequence[Flight]) -> list[Case]:
    """Clean airborne spans of ``flights``, found by their audit."""
    return training_cases(flights, {flight.name: audit(flight) for flight in flights})


def cut(cases: Sequence[Case], truth: str = "onboard", past: bool = False, thin: int | None = None,
        most: int = MOST_WINDOWS, start: str = "centred") -> list[Cut]:
    """Windows of every case, every ``thin``-th (by default so that there are about ``most``); ``start``: as of
    ``cut_windows``."""
    found = [(case, cut_windows(case.flight, case.spans, truth, past, start, case.recorded)) for case in cases]
    whole = [(case, both) for case, both in found if both is not None]
    thin = thin or max(1, round(sum(len(both[0]) for _, both in whole) / most))
    return [Cut(case.flight.name, array_fields.rows(windows, slice(number % thin, None, thin)),
                array_fields.rows(came, slice(number % thin, None, thin)), thin)
            for number, (case, (windows, came)) in enumerate(whole)]


def mean_errors(predict: Callable[[Windows], Prediction], cuts: Sequence[Cut]) -> dict[str, dict[str, float]]:
    """Task 1 errors {metric: {"1", "10", "50", "sum"}} over all windows of ``cuts``. UsageError without windows."""
    sums: dict[str, np.ndarray] = {}
    for c in cuts:
        for name, error in window_errors(predict(c.windows), c.came).items():
            sums[name] = sums.get(name, 0.0) + error.sum(axis=0)
    count = sum(len(c.windows) for c in cuts)
    if not count:
        raise UsageError("no window of clean flight to score")
    return {name: multi_horizon(total / count) for name, total in sums.items()}


def gather(cuts: Sequence[Cut], place: str = "training flights") -> FitWindows:
    """The windows of all flights end to end. InputError where they contain no information."""
    if not cuts or not any(len(c.windows) for c in cuts):
        raise InputError(place, f"no flight with {', '.join(SYSID)} streams and half a second of clean flight",
                         "nanobench audit says what each recording lacks")
    columns = zip(*((start_of(c.windows), c.windows.motor, c.windows.battery_V, *past_inputs(c.windows),
                     np.concatenate([c.came.position_m, c.came.velocity_m_s, c.came.quaternion, c.came.rate_rad_s], 2),
                     np.full(len(c.windows), i)) for i, c in enumerate(cuts)), strict=True)
    start, motor, battery, motor_past, battery_past, came, flight = map(np.concatenate, columns)
    still = [f"m{i + 1}" for i in range(4) if motor[..., i].std() < STILL]
    if still:
        raise InputError(place, f"PWM of {', '.join(still)} never changes", "a fit needs motors that do something")
    return FitWindows(start, motor, battery, (motor_past, battery_past), came, flight, tuple(c.name for c in cuts),
                      cuts[0].windows.rate_hz)

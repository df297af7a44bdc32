"""How far off a row of a new recording may be: the spread within files, between files, and of what was fitted.

Flights of one session share propellers, battery and air, so they say little about those of another day. The spread
between flights therefore has as many degrees of freedom as there are sessions. The uncertainty of the fit itself is
the spread of refits to drawn training flights. It covers a test flight whose motors are more uneven than those of any
training flight.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from nanobench_tools.protocols.sessions import Sessions
from nanobench_tools.settings import count

from .flight_fit import FlightFit, FlightModel
from .flight_rows import Flown

PROBABILITY = 0.95

FEWEST_SESSIONS = count("thrust.prediction_intervals.fewest_sessions")

FEW_ROWS = count("thrust.prediction_intervals.few_rows")


def sessions(epochs_s: Sequence[float]) -> int:
    """Number of sessions of recordings with these Unix times. Each one without a time (0) is a session; those whose
    clock started with the vehicle are one session together.

    >>> sessions([0.0, 0.0, 1e9, 1e9 + 600.0, 1e9 + 86400.0])
    4
    """
    stamps = [s for s in epochs_s if s]
    return len(epochs_s) - len(stamps) + len(np.unique(Sessions.at(stamps).labels_at(stamps)))


def half_width(found: Sequence[np.ndarray], files: int, unseen: float = 0.0, groups: int | None = None) -> float:
    """Half width of the interval for a row of a new file from held-out errors (one array per file). It combines the
    spread within files and that of the files' means. The latter has as many degrees of freedom as there are ``groups``
    (sessions; by default files).

    unseen: SD between files that one file alone is given. The result is nan without errors."""
    if not found:
        return float("nan")
    high = 0.5 + 0.5 * PROBABILITY
    if files < 2:
        pooled = float(np.sqrt(np.mean(np.concatenate(list(found)) ** 2)))
        return float(student.ppf(high, max(sum(map(len, found)) - 1, 1)) * np.hypot(pooled, unseen))
    within = float(np.sqrt(np.mean(np.concatenate([e - e.mean() for e in found]) ** 2)))
    means = np.array([e.mean() for e in found])
    between = float(np.sqrt(np.mean(means**2) * (1.0 + 1.0 / files)))
    free = min(files, max(groups or files, FEWEST_SESSIONS)) - 1
    return float(np.hypot(student.ppf(high, free) * between, norm.ppf(high) * within))


def in_turn(found: Sequence[np.ndarray], files: int, groups: int | None = None) -> float | None:
    """Share of held-out rows inside the interval that the errors of the other files give; None for one file."""
    if files < 3 or len(found) != files:
        return None
    inside = [float(np.sum(np.abs(e) <= half_width([o for o in found if o is not e], files - 1, 0.0, groups)))
              for e in found]
    return sum(inside) / sum(map(len, found))


def refit_spread(model: FlightModel, draws: Sequence[Mapping[str, float]], flown: Flown) -> float:
    """SD [m/s^2] of the mean prediction of refits to drawn flights; 0 without any."""
    few = flown.rows(slice(None, None, -(-len(flown) // FEW_ROWS)))
    names = [s.name for s in model.map.shape]
    means = [float(FlightFit(model, values, tuple(values[n] for n in names)).predict(few).mean())
             for values in draws if all(np.isfinite(list(values.values())))]
    return float(np.std(means)) if len(means) > 1 else 0.0


def widened(half: float, model: object, draws: Sequence[Mapping[str, float]], file: object) -> float:
    """``half`` with the spread of refits at this file added (flights; a stand series keeps it)."""
    if not isinstance(model, FlightModel) or not isinstance(file, Flown) or not draws:
        return half
    return float(np.hypot(half, norm.ppf(0.5 + 0.5 * PROBABILITY) * refit_spread(model, draws, file)))

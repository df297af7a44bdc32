"""How wrong and how sure over time: single estimates with what they say of themselves, for pictures.

For ``aided``, the flight whose error is the median of a method's. For ``blackout``, the longest window whose end error
is the median. It is the same one for every method. To show another flight, give that one alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..auditing.usable import POSE
from ..flight import Span
from ..flight import mask_of as inside
from ..methods import Estimate, Estimator
from ..metrics.association import snap
from ..results.result import Result
from .aided import Aiding, given_to
from .blackout import given_until
from .result_rows import BlackoutScore, Scored
from .task3 import Case, checked

ROWS = 300
"""An estimate is thinned to so many rows, evenly."""


@dataclass(frozen=True, repr=False)
class Band(Result):
    """At most ROWS rows: t_s (k,) after an origin; truth, error and SD (k, 3) m, world; covariance of x and y (k,)."""

    t_s: list[float]
    truth_m: list[list[float]]
    error_m: list[list[float]]
    sd_m: list[list[float]]
    cov_xy_m2: list[float]


@dataclass(frozen=True, repr=False)
class MaybeBand(Result):
    """None for an estimate without a covariance."""

    band: Band | None


def median_case(scored: Sequence[tuple[Case, Scored]]) -> Case | None:
    """Of (case, value) the case whose ATE is the median; None where no estimate says how sure it is."""
    known = [(value.metrics.get("ate_rmse_m"), case) for case, value in scored
             if np.isfinite(value.metrics.get("nees", np.nan) or np.nan)]
    ranked = sorted((pair for pair in known if pair[0] is not None), key=lambda pair: (pair[0], pair[1].flight.name))
    return ranked[(len(ranked) - 1) // 2][1] if ranked else None


def median_window(scored: Sequence[tuple[Case, BlackoutScore]]) -> tuple[Case, float, float] | None:
    """(case, t0_s, h_s) of the window of the longest horizon there is whose end error is the median; None where no
    estimate says how sure it is."""
    known = [(window.h_s, window.error_m, window.t0_s, case) for case, value in scored
             for window in value.windows if window.inside_3_sigma is not None]
    if not known:
        return None
    longest = max(h for h, *_ in known)
    ranked = sorted((one for one in known if one[0] == longest), key=lambda one: (one[1], one[3].flight.name, one[2]))
    h, _, t0, case = ranked[(len(ranked) - 1) // 2]
    return case, t0, h


def aided_band(case: Case, method: Estimator, aiding: Aiding, seed: int) -> MaybeBand:
    """Of one flight with few, late and noisy poses."""
    made = checked(method.estimate(given_to(case, aiding, seed)), method.name, case.flight.provenance.path)
    return MaybeBand(band_of(case, made, case.spans))


def blackout_band(case: Case, method: Estimator, t0_s: float, h_s: float) -> MaybeBand:
    """The same from the last pose on, for one horizon."""
    made = checked(method.estimate(given_until(case.flight, t0_s)), method.name, case.flight.provenance.path)
    return MaybeBand(band_of(case, made, [Span(t0_s, t0_s + h_s)], t0_s))


def band_of(case: Case, estimate: Estimate, spans: Sequence[Span], origin_s: float = 0.0) -> Band | None:
    """None without a covariance."""
    if estimate.covariance is None:
        return None
    mocap = case.flight["mocap"]
    good = np.isfinite(mocap[POSE]).all(axis=1)
    truth_s, truth = mocap.time_s[good], mocap["px", "py", "pz"][good]
    time_s = snap(estimate.time_s, mocap.time_s)
    rows = np.flatnonzero(inside(spans, time_s) & (time_s >= truth_s[0]) & (time_s <= truth_s[-1]))
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, ROWS).astype(int))] if len(rows) else rows
    there = np.stack([np.interp(time_s[rows], truth_s, column) for column in truth.T], axis=1)
    covariance = np.asarray(estimate.covariance, float)[rows, :3, :3]
    sd = np.sqrt(np.einsum("nkk->nk", covariance).clip(0.0))
    return Band(_short(time_s[rows] - origin_s, 3), _short(there, 4), _short(estimate.position_m[rows] - there, 5),
                _short(sd, 5), [float(f"{value:.4g}") for value in covariance[:, 0, 1]])


def _short(values: np.ndarray, digits: int) -> list[Any]:
    return list(np.round(values, digits).tolist())



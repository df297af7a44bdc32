"""Task 3, blackout: poses until t0 and none afterwards; how far off is the position 1, 5, 10 and 20 s later.

t0 every 5 s from 5 s after the start of the flight. A window counts where the vehicle is in the air and the truth and
the streams are free of faults from t0 to its end. One call of the estimator per t0: ``flight.streams["mocap"]`` holds
the poses up to t0, all other streams are whole.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..auditing.usable import POSE
from ..errors import InputError
from ..flight import Flight, make_stream
from ..methods import Estimate, Estimator
from .result_rows import BlackoutScore, EndError, EstimateRow, Spread
from .score_tables import group_order, summaries
from .scoring3 import in_band
from .sessions import Drawn, Sessions
from .task3 import BLACKOUT, Case, checked, given_and_trained, inputs_of

FIRST_S, EVERY_S = 5.0, 5.0
HORIZONS_S = (1.0, 5.0, 10.0, 20.0)
CONSISTENT_S = (0.0, *HORIZONS_S)
"""After the last pose; an error is compared with the stated covariance at these."""
GIVEN = "motion capture poses until t0, none afterwards; all other streams"
INPUTS = "poses until t0"
KINDS = {"": "error_m", "horizontal_": "horizontal_m", "vertical_": "vertical_m"}
"""Parts of an end error: of what a metric is called -> of what a window holds."""

LEAST_PATH_M = 0.1
"""A drift in per cent says nothing of a vehicle that hovers."""
NEAREST_S = 0.05
"""An estimate counts at the end of a window if it has a timestamp within this of it."""
INSIDE_3_SIGMA = 14.16
"""Squared normalised error [1] that 99.73 % of three-dimensional Gaussian errors stay below (chi-square)."""


def starts(case: Case) -> list[float]:
    """The t0 [s] of one flight, those with at least the shortest horizon."""
    first = case.spans[0].start_s + FIRST_S
    return [t0 for t0 in np.arange(first, case.spans[-1].end_s, EVERY_S).tolist() if _whole(case, t0, HORIZONS_S[0])]


def _whole(case: Case, t0_s: float, h_s: float) -> bool:
    return any(span.start_s <= t0_s and t0_s + h_s <= span.end_s for span in case.spans)


def given_until(flight: Flight, t0_s: float) -> Flight:
    """The flight with the poses up to t0 only (columns px py pz qx qy qz qw)."""
    mocap = flight["mocap"]
    early = (mocap.time_s <= t0_s) & np.isfinite(mocap[POSE]).all(axis=1)
    poses = make_stream("mocap", mocap.time_s[early], mocap[POSE][early], POSE, rate_hz=mocap.rate_hz)
    return replace(flight, streams={**flight.streams, "mocap": poses})


def score(case: Case, method: Estimator) -> BlackoutScore:
    """Metrics: end_error_Hs_m and the same with horizontal_ and vertical_, drift_percent_Hs.

    Where a covariance is stated also nees_Hs, nees_in_band_Hs and inside_3_sigma_Hs_percent, from 0 s on
    (``consistency_after``).

    Raises InputError when the estimator gives no trajectory or does not reach the end of a window.
    """
    windows: list[EndError] = []
    squared: dict[float, list[float]] = {h: [] for h in CONSISTENT_S}
    mocap = case.flight["mocap"]
    finite = np.isfinite(mocap[POSE]).all(axis=1)
    truth_s, truth_m = mocap.time_s[finite], mocap["px", "py", "pz"][finite]
    for t0 in starts(case):
        estimate = checked(method.estimate(given_until(case.flight, t0)), method.name, case.flight.provenance.path)
        for h in CONSISTENT_S:
            if not _whole(case, t0, h):
                continue
            end = t0 + h
            if not len(estimate.time_s) or np.min(np.abs(estimate.time_s - end)) > NEAREST_S:
                raise InputError(case.flight.provenance.path, f"estimator {method.name} has no value at {end:.2f} s")
            found = np.array([np.interp(end, estimate.time_s, estimate.position_m[:, k]) for k in range(3)])
            true = np.array([np.interp(end, truth_s, truth_m[:, k]) for k in range(3)])
            off = found - true
            nees = _normalised(estimate, end, off)
            squared[h] += [] if nees is None else [nees]
            if h not in HORIZONS_S:
                continue
            flown = truth_m[(truth_s >= t0) & (truth_s <= end)]
            path_m = float(np.linalg.norm(np.diff(flown, axis=0), axis=1).sum())
            error_m = float(np.linalg.norm(off))
            windows.append(EndError(t0, h, found.tolist(), error_m, float(np.hypot(off[0], off[1])), float(abs(off[2])),
                                    100.0 * error_m / path_m if path_m > LEAST_PATH_M else float("nan"),
                                    None if nees is None else nees <= INSIDE_3_SIGMA, nees))
    metrics: dict[str, float] = {}
    for h in HORIZONS_S:
        mine = [w for w in windows if w.h_s == h]
        for kind, key in KINDS.items():
            value = float(np.mean([getattr(w, key) for w in mine])) if mine else float("nan")
            metrics[f"end_error_{kind}{h:.0f}s_m"] = value
        metrics[f"drift_percent_{h:.0f}s"] = _mean([w.drift_percent for w in mine])
    return BlackoutScore(windows, metrics | consistency_after(squared))


def consistency_after(squared: Mapping[float, Sequence[float]]) -> dict[str, float]:
    """From {seconds after the last pose: NEES of the windows of one flight}.

    - ``nees_Hs``: their mean, 3 if consistent.
    - ``nees_in_band_Hs``: 1 if the mean lies in the 95 % band of chi-square, else 0. Windows that overlap count as many
      as fit side by side.
    - ``inside_3_sigma_Hs_percent``: share of the windows.
    """
    found: dict[str, float] = {}
    for h, values in squared.items():
        key = f"{h:.0f}s"
        independent = max(len(values) * EVERY_S / max(h, EVERY_S), 1.0)
        mean = _mean(values)
        found[f"nees_{key}"] = mean
        found[f"nees_in_band_{key}"] = in_band(mean, 3.0, independent) if values else float("nan")
        found[f"inside_3_sigma_{key}_percent"] = _mean([100.0 * (value <= INSIDE_3_SIGMA) for value in values])
    return found


def _normalised(estimate: Estimate, end_s: float, off_m: np.ndarray) -> float | None:
    """Squared error (3,) m over the covariance that the estimate states at its nearest timestamp."""
    if estimate.covariance is None:
        return None
    stated = np.asarray(estimate.covariance, float)[int(np.argmin(np.abs(estimate.time_s - end_s))), :3, :3]
    if not np.isfinite(stated).all():
        return None
    try:
        white = np.linalg.solve(np.linalg.cholesky(stated), off_m)
    except np.linalg.LinAlgError:
        return None
    return float(white @ white)


def _mean(values: Sequence[float]) -> float:
    finite = [v for v in values if np.isfinite(v)]
    return float(np.mean(finite)) if finite else float("nan")


def over_windows(scored: Sequence[BlackoutScore]) -> dict[str, Spread]:
    """{end_error_Hs_m: ...} over all windows of the flights, also horizontal and vertical."""
    found: dict[str, Spread] = {}
    for kind, key in KINDS.items():
        for h in HORIZONS_S:
            errors = [getattr(w, key) for value in scored for w in value.windows if w.h_s == h]
            if errors:
                found[f"end_error_{kind}{h:.0f}s_m"] = Spread(len(errors), float(np.median(errors)),
                                                              float(np.percentile(errors, 90.0)))
    return found


def tabulate(method: Estimator, scored: Sequence[tuple[Case, BlackoutScore]],
             seed: int = 0, sessions: Sessions | None = None) -> list[EstimateRow]:
    """Rows as in the other protocols: one per group, a summary over flights (each the mean of its windows), and
    ``over_windows``. ``sessions``: of all recordings of the run; None: of the scored ones alone."""
    scored = [(case, value) for case, value in scored if value.windows]
    sessions = sessions or Sessions.of(case.flight for case, _ in scored)
    rows = []
    for group in group_order([g for case, _ in scored for g in case.groups]):
        members = [(case, value) for case, value in scored if group in case.groups]
        labels = sessions.labels(case.flight for case, _ in members)
        metrics = summaries([value.metrics for _, value in members], seed, labels)
        counts = {f"{h:.0f}": sum(w.h_s == h for _, value in members for w in value.windows) for h in HORIZONS_S}
        rows.append(EstimateRow(
            protocol=BLACKOUT, method=method.name, causal=getattr(method, "causal", None), group=group, n=len(members),
            flights=[case.flight.name for case, _ in members], n_windows=counts,
            given=given_and_trained(method, GIVEN), inputs=inputs_of(method, INPUTS),
            over_windows=over_windows([v for _, v in members]),
            drawn=Drawn.of(labels, metrics), metrics=metrics))
    return rows

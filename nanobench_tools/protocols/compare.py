"""Rows against each other: the ratio of their errors over the same flights and windows, with its own interval.

Two rows whose intervals overlap may still differ, since flights differ more than methods do. Both rows' flights are
resampled together, sessions first (``metrics.statistics.paired_ratio``). A row is called better than another only if
the interval of the ratio excludes one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..metrics.prediction import HORIZONS, QUANTITIES
from ..metrics.statistics import PairedRatio, excludes_one, paired_ratio
from ..results.result import INLINE, Result
from .blackout import KINDS
from .gate import GateRow
from .result_rows import ClockRatios, EstimateRow, FlightScore, Metrics, Ratios, WindowScore
from .sessions import Sessions
from .task1 import PredictionRow, WindowErrors
from .task3 import BLACKOUT

COMPARED_WITH = "drag_matrix_ekf"
"""The method that others are compared with where it is among them, else the first one of the table."""
ERRORS = ("_m", "_m_s", "_deg", "_rad", "_rad_s")
"""Endings of metrics that are errors, of which a ratio says something; and drifts."""
KEYS = (*map(str, HORIZONS), "sum")

Scores = Mapping[str, Metrics]
"""{flight: {metric: value}} of one row."""


def reference(names: Sequence[str]) -> str | None:
    """Which of several methods the others are compared with; None for one alone."""
    several = list(dict.fromkeys(names))
    if len(several) < 2:
        return None
    return COMPARED_WITH if COMPARED_WITH in several else several[0]


def ratios(flights: Sequence[str], ours: Scores, theirs: Scores, to: str, labels: Mapping[str, int], seed: int = 0,
           kind: type[Ratios] = Ratios) -> Any:
    """Mean error of ours over that of ``to``, by metric, over the ``flights`` that both scored; ``labels``: session of
    every flight."""
    names = [name for name in flights if name in ours and name in theirs]
    metrics = [m for m in dict.fromkeys(m for name in names for m in ours[name]) if is_error(m)]
    a, b = (np.array([[_number(of[name].get(m)) for m in metrics] for name in names], float)
            .reshape(len(names), len(metrics)) for of in (ours, theirs))
    errors = [k for k in range(len(metrics)) if not (a[:, k] < 0.0).any() and not (b[:, k] < 0.0).any()]
    found = dict(zip([metrics[k] for k in errors], paired_ratio(a[:, errors], b[:, errors], seed,
                                                                [labels[name] for name in names]), strict=True))
    return kind({m: one.ratio for m, one in found.items() if one.n}, {m: one.ci95 for m, one in found.items() if one.n},
                to)


def is_error(metric: str) -> bool:
    """Whether a smaller value of ``metric`` is a better one, and zero the best."""
    return metric.endswith(ERRORS) or metric.startswith("drift")


def methods(rows: Sequence[EstimateRow], scores: Mapping[str, Scores], labels: Mapping[str, int],
            seed: int = 0) -> list[EstimateRow]:
    """The rows of one table, of one clock, each compared with the ``reference`` among methods with the same inputs;
    scores by method."""
    alike: dict[str, list[str]] = {}
    for row in rows:
        alike.setdefault(row.inputs, []).append(row.method)
    to = {inputs: reference(names) for inputs, names in alike.items()}
    return [row if (other := to[row.inputs]) is None or row.method == other else
            replace(row, ratios=ratios(row.flights, scores[row.method], scores[other], other, labels, seed))
            for row in rows]


def clocks(rows: Sequence[EstimateRow], per_flight: Sequence[FlightScore], windows: Sequence[WindowScore],
           recorded: str, labels: Mapping[str, int], seed: int = 0) -> list[EstimateRow]:
    """Compares rows on another clock with the same method as ``recorded``, from the scores of single flights. For dead
    reckoning it uses the windows that both clocks have."""
    scores: dict[tuple[str, str, str], dict[str, Metrics]] = {}
    by_clock: dict[tuple[str, str], list[WindowScore]] = {}
    for one in per_flight:
        scores.setdefault((one.protocol, one.method, one.clock), {})[one.flight] = one.metrics
    for window in windows:
        by_clock.setdefault((window.method, window.clock), []).append(window)
    pairs: dict[tuple[str, str, str], tuple[Scores, Scores]] = {
        (protocol, method, clock): (found, scores[protocol, method, recorded])
        for (protocol, method, clock), found in scores.items() if (protocol, method, recorded) in scores}
    for (method, clock), mine in by_clock.items():
        other = by_clock.get((method, recorded), [])
        pairs[BLACKOUT, method, clock] = (of_windows(mine, other), of_windows(other, mine))
    return [row if row.clock == recorded or (key := (row.protocol, row.method, row.clock)) not in pairs else
            replace(row, clock_ratios=ratios(row.flights, *pairs[key], recorded, labels, seed, ClockRatios))
            for row in rows]


HEADLINE = ("ate_rmse_m", "end_error_5s_m", "drift_percent")
"""The metric that stands for a protocol: the first that a row has."""


@dataclass(frozen=True, repr=False)
class ClockRanking(Result):
    """The best of several methods that were given the same, by clock; errors: {clock: {method: mean}}."""

    protocol: str
    inputs: str
    metric: str
    best: Mapping[str, str]
    errors: Mapping[str, Mapping[str, float]]

    @property
    def decides(self) -> bool:
        """Whether the clock decides which method is best."""
        return len(set(self.best.values())) > 1


def rankings(rows: Sequence[EstimateRow]) -> list[ClockRanking]:
    """Of every protocol that was scored on several clocks, over all flights; methods that every clock has."""
    found = []
    for protocol, inputs in dict.fromkeys((row.protocol, row.inputs) for row in rows):
        mine = [row for row in rows if (row.protocol, row.inputs, row.group) == (protocol, inputs, "all")]
        metric = next((m for m in HEADLINE if any(m in row.metrics for row in mine)), None)
        errors: dict[str, dict[str, float]] = {}
        for row in mine:
            if metric is not None and metric in row.metrics and (mean := row.metrics[metric].mean) is not None:
                errors.setdefault(row.clock, {}).setdefault(row.method, mean)
        shared = set.intersection(*map(set, errors.values())) if errors else set()
        if metric is None or len(errors) < 2 or len(shared) < 2:
            continue
        errors = {clock: {m: e for m, e in each.items() if m in shared} for clock, each in errors.items()}
        found.append(ClockRanking(protocol, inputs, metric, {
            clock: min(each, key=lambda m: each[m]) for clock, each in errors.items()}, errors))
    return found


def of_windows(windows: Sequence[WindowScore], shared: Sequence[WindowScore]) -> dict[str, dict[str, float]]:
    """{flight: {end_error_Hs_m ...: mean}} of dead reckoning over the ``windows`` whose flight, start and length are
    among ``shared`` too."""
    there = {_window(w) for w in shared}
    found: dict[str, dict[str, list[float]]] = {}
    for w in windows:
        if _window(w) in there:
            for kind, key in KINDS.items():
                metric = f"end_error_{kind}{w.end.h_s:.0f}s_m"
                found.setdefault(w.flight, {}).setdefault(metric, []).append(getattr(w.end, key))
    return {name: {metric: float(np.mean(v)) for metric, v in metrics.items()} for name, metrics in found.items()}


def _window(window: WindowScore) -> tuple[str, float, float]:
    return window.flight, round(window.end.t0_s, 1), window.end.h_s


def predictions(rows: Sequence[PredictionRow], scored: Mapping[tuple[str, str], Sequence[tuple[Any, WindowErrors]]],
                to: str | None, sessions: Sessions, seed: int = 0) -> list[PredictionRow]:
    """Rows of Task 1 with pooled errors over those of the model ``to``, the same windows for both; ``scored``: (case,
    score) by (model, truth)."""
    sums = {key: {case.flight.name: (case, value) for case, value in found} for key, found in scored.items()}
    found = []
    for row in rows:
        ours, theirs = sums.get((row.model, row.truth), {}), sums.get((str(to), row.truth), {})
        pairs = [(case, one, other) for name, (case, value) in ours.items() if name in theirs
                 and (one := _of_group(case, value, row.group))
                 and (other := _of_group(case, theirs[name][1], row.group))]
        if to is not None and row.model != to and pairs:
            a, b = (np.array([_sums(x) for x in side]) for side in ([p[1] for p in pairs], [p[2] for p in pairs]))
            b *= np.array([one.windows / other.windows for _, one, other in pairs])[:, None]
            labels = sessions.labels(case.flight for case, _, _ in pairs)
            row = replace(row, ratios=Ratios(*_by_horizon(paired_ratio(a, b, seed, labels)), to))
        found.append(row)
    return found


@dataclass(frozen=True, repr=False)
class FlightMeans(Result):
    """The mean error of one model on one flight and clock: {metric: {"1", "10", "50", "sum"}}."""

    model: str
    truth: str
    flight: str
    clock: str
    groups: Sequence[str]
    n_windows: int
    metrics: Mapping[str, Mapping[str, float]]


def flight_means(scored: Mapping[tuple[str, str], Sequence[tuple[Any, WindowErrors]]],
                 clock: str) -> list[FlightMeans]:
    """Of every model on every flight; scored: (case, score) by (model, truth)."""
    return [FlightMeans(model, truth, case.flight.name, clock, list(case.groups), value.windows,
                        {name: dict(zip(KEYS, (np.array(sums) / value.windows).tolist(), strict=True))
                         for name, sums in zip(QUANTITIES, np.reshape(_sums(value), (-1, len(KEYS))), strict=True)})
            for (model, truth), found in scored.items() for case, value in found if value.windows]


def prediction_clocks(rows: Sequence[PredictionRow], per_flight: Sequence[FlightMeans], recorded: str,
                      labels: Mapping[str, int], seed: int = 0) -> list[PredictionRow]:
    """Rows of Task 1 on another clock compared with the same model as ``recorded``; a flight counts with its windows as
    recorded."""
    by_clock: dict[tuple[str, str, str], dict[str, FlightMeans]] = {}
    for one in per_flight:
        by_clock.setdefault((one.model, one.truth, one.clock), {})[one.flight] = one
    found = []
    for row in rows:
        ours, theirs = (by_clock.get((row.model, row.truth, clock), {}) for clock in (row.clock, recorded))
        names = [name for name, one in ours.items() if name in theirs and row.group in one.groups]
        if row.clock != recorded and row.start == "centred" and names:
            a, b = (np.array([[of[name].metrics[m][h] * theirs[name].n_windows for m in QUANTITIES for h in KEYS]
                              for name in names]) for of in (ours, theirs))
            ratio = paired_ratio(a, b, seed, [labels[name] for name in names])
            row = replace(row, clock_ratios=ClockRatios(*_by_horizon(ratio), recorded))
        found.append(row)
    return found


@dataclass(frozen=True, repr=False)
class GateChange(Result):
    """What another clock does to one figure of the gate: ratio over the same flights, both means."""

    paired: PairedRatio = field(metadata=INLINE)
    mean: float
    mean_recorded: float


def gates(rows: Sequence[GateRow], recorded: Sequence[GateRow], labels: Mapping[str, int],
          seed: int = 0) -> dict[str, GateChange]:
    """The gate on another clock against the same flights as ``recorded``. Compared are path gap, errors of lag and
    RMSE ratio, and the share of flights that fail."""
    ours, theirs = ({row.flight: _gate_errors(row) for row in found} for found in (rows, recorded))
    names = [name for name in ours if name in theirs]
    if not names:
        return {}
    a, b = (np.array([list(of[name].values()) for name in names], float) for of in (ours, theirs))
    found = paired_ratio(a, b, seed, [labels[name] for name in names])
    return {what: GateChange(one, float(a[:, k].mean()), float(b[:, k].mean()))
            for k, (what, one) in enumerate(zip(ours[names[0]], found, strict=True))}


def _gate_errors(row: GateRow) -> dict[str, float]:
    return {"path_gap_m": row.path_gap_m, "lag_off_s": abs(row.lag_diff_s), "rmse_ratio_off": abs(row.ratio - 1.0),
            "failed_share": float(not row.passed)}


def _by_horizon(found: Sequence[PairedRatio]) -> tuple[
        dict[str, dict[str, float | None]], dict[str, dict[str, tuple[float, float] | None]]]:
    """Ratios and intervals as {metric: {horizon: ...}}."""
    table = {name: dict(zip(KEYS, found[k:k + len(KEYS)], strict=True))
             for name, k in zip(QUANTITIES, range(0, len(found), len(KEYS)), strict=True)}
    return ({name: {h: one.ratio for h, one in by.items()} for name, by in table.items()},
            {name: {h: one.ci95 for h, one in by.items()} for name, by in table.items()})


def _of_group(case: Any, value: WindowErrors, group: str) -> WindowErrors | None:
    found = value if group in case.groups else value.battery.get(group)
    return found if found and found.windows else None


def _sums(value: WindowErrors) -> list[float]:
    return [x for name in QUANTITIES for x in (*(value.sums[name][h - 1] for h in HORIZONS), sum(value.sums[name]))]


def verdict(ratio: float | None, ci95: Sequence[float] | None) -> str:
    """In words, what a ratio says. A difference is only called one where the interval excludes one.

    >>> verdict(0.9, [0.85, 0.96]), verdict(0.9, [0.8, 1.1]), verdict(0.9, None)
    ('10 % less (ratio 0.85 .. 0.96)', 'no difference shown (ratio 0.80 .. 1.10)', 'ratio 0.90, without interval')
    """
    if ratio is None:
        return ""
    if ci95 is None:
        return f"ratio {ratio:.2f}, without interval"
    change = f"{100.0 * abs(ratio - 1.0):.0f} % {'less' if ratio < 1.0 else 'more'}"
    return f"{change if excludes_one(ci95) else 'no difference shown'} (ratio {ci95[0]:.2f} .. {ci95[1]:.2f})"


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)

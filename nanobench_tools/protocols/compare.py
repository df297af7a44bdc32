"""Rows against each other: the ratio of their errors over the same flights and windows, with an interval of its own.

Two rows whose intervals overlap may still differ: flights differ more than methods do. Both rows' flights are drawn
together, sessions first (``metrics.statistics.paired_ratio``). A row is called better than another only where the
interval of the ratio excludes one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..metrics.prediction import HORIZONS, QUANTITIES
from ..metrics.statistics import excludes_one, paired_ratio
from .blackout import KINDS
from .sessions import Sessions
from .task3 import BLACKOUT

COMPARED_WITH = "drag_matrix_ekf"
"""The method that others are compared with where it is among them, else the first one of the table."""
ERRORS = ("_m", "_m_s", "_deg", "_rad", "_rad_s")
"""Endings of metrics that are errors, of which a ratio says something; and drifts."""
KEYS = (*map(str, HORIZONS), "sum")

Scores = Mapping[str, Mapping[str, float | None]]
"""{flight: {metric: value}} of one row."""


def reference(names: Sequence[str]) -> str | None:
    """Which of several methods the others are compared with; None for one alone."""
    several = list(dict.fromkeys(names))
    if len(several) < 2:
        return None
    return COMPARED_WITH if COMPARED_WITH in several else several[0]


def compare(row: dict[str, Any], ours: Scores, theirs: Scores, to: str, labels: Mapping[str, int], seed: int = 0,
            prefix: str = "ratio") -> None:
    """Adds ``ratio`` {metric: mean error of the row over that of ``to``}, ``ratio_ci95`` {metric: [lo, hi] | None} and
    ``ratio_to`` to a row, over its ``flights`` that both scored; labels: session of every flight. prefix: other names
    of the keys."""
    names = [name for name in row["flights"] if name in ours and name in theirs]
    metrics = [m for m in dict.fromkeys(m for name in names for m in ours[name]) if is_error(m)]
    a, b = (np.array([[_number(of[name].get(m)) for m in metrics] for name in names], float)
            .reshape(len(names), len(metrics)) for of in (ours, theirs))
    errors = [k for k in range(len(metrics)) if not (a[:, k] < 0.0).any() and not (b[:, k] < 0.0).any()]
    found = dict(zip([metrics[k] for k in errors], paired_ratio(a[:, errors], b[:, errors], seed,
                                                                [labels[name] for name in names]), strict=True))
    row[prefix] = {m: one["ratio"] for m, one in found.items() if one["n"]}
    row[f"{prefix}_ci95"] = {m: one["ci95"] for m, one in found.items() if one["n"]}
    row[f"{prefix}_to"] = to


def is_error(metric: str) -> bool:
    """Whether a smaller value of ``metric`` is a better one, and zero the best."""
    return metric.endswith(ERRORS) or metric.startswith("drift")


def methods(rows: Sequence[dict[str, Any]], scores: Mapping[str, Scores], labels: Mapping[str, int],
            seed: int = 0) -> None:
    """Compares the rows of one table, of one clock, with the ``reference`` method; scores by method."""
    to = reference(list(scores))
    for row in rows:
        if to is not None and row["method"] != to:
            compare(row, scores[row["method"]], scores[to], to, labels, seed)


def clocks(body: Mapping[str, Any], recorded: str, labels: Mapping[str, int], seed: int = 0) -> None:
    """Compares rows of estimate.json on another clock with the same method as ``recorded``: ``clock_ratio``,
    ``clock_ratio_ci95``, ``clock_ratio_to``. From its ``per_flight``, and its ``windows`` of dead reckoning that both
    clocks have."""
    scores: dict[tuple[str, str, str], dict[str, Any]] = {}
    windows: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for one in body.get("per_flight", ()):
        scores.setdefault((one["protocol"], one["method"], one["clock"]), {})[one["flight"]] = one["metrics"]
    for window in body.get("windows", ()):
        windows.setdefault((window["method"], window["clock"]), []).append(window)
    pairs = {(protocol, method, clock): (found, scores[protocol, method, recorded])
             for (protocol, method, clock), found in scores.items() if (protocol, method, recorded) in scores}
    for (method, clock), mine in windows.items():
        other = windows.get((method, recorded), [])
        pairs[BLACKOUT, method, clock] = (of_windows(mine, other), of_windows(other, mine))
    for row in body["rows"]:
        key = (row["protocol"], row["method"], row["clock"])
        if row["clock"] != recorded and key in pairs:
            compare(row, *pairs[key], recorded, labels, seed, "clock_ratio")


def of_windows(windows: Sequence[Mapping[str, Any]],
               shared: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """{flight: {end_error_Hs_m ...: mean}} of dead reckoning over the ``windows`` whose flight, start and length are
    among ``shared`` too."""
    there = {_window(w) for w in shared}
    found: dict[str, dict[str, list[float]]] = {}
    for w in windows:
        if _window(w) in there:
            for kind, key in KINDS.items():
                metric = f"end_error_{kind}{w['h_s']:.0f}s_m"
                found.setdefault(w["flight"], {}).setdefault(metric, []).append(w[key])
    return {name: {metric: float(np.mean(v)) for metric, v in metrics.items()} for name, metrics in found.items()}


def _window(window: Mapping[str, Any]) -> tuple[str, float, float]:
    return window["flight"], round(window["t0_s"], 1), window["h_s"]


def predictions(rows: Sequence[dict[str, Any]], scored: Mapping[tuple[str, str], Sequence[tuple[Any, Any]]],
                to: str | None, sessions: Sessions, seed: int = 0) -> None:
    """Adds ``ratio`` {metric: {"1", "10", "50", "sum"}}, ``ratio_ci95`` and ``ratio_to`` to rows of Task 1: pooled
    errors over those of the model ``to``, the same windows for both; scored: (case, score) by (model, truth)."""
    sums = {key: {case.flight.name: (case, value) for case, value in found} for key, found in scored.items()}
    for row in rows:
        ours, theirs = sums.get((row["model"], row["truth"]), {}), sums.get((str(to), row["truth"]), {})
        pairs = [(case, one, other) for name, (case, value) in ours.items() if name in theirs
                 and (one := _of_group(case, value, row["group"]))
                 and (other := _of_group(case, theirs[name][1], row["group"]))]
        if to is None or row["model"] == to or not pairs:
            continue
        a, b = (np.array([_sums(p[side]) for p in pairs]) for side in (1, 2))
        b *= np.array([p[1]["windows"] / p[2]["windows"] for p in pairs])[:, None]
        _add(row, paired_ratio(a, b, seed, sessions.labels(case.flight for case, _, _ in pairs)), str(to), "ratio")


def flight_means(scored: Mapping[tuple[str, str], Sequence[tuple[Any, Any]]], clock: str) -> list[dict[str, Any]]:
    """[{model, truth, flight, clock, groups, n_windows, metrics: {metric: {"1", "10", "50", "sum"}}}]: the mean error
    of every model on every flight; scored: (case, score) by (model, truth)."""
    return [{"model": model, "truth": truth, "flight": case.flight.name, "clock": clock, "groups": list(case.groups),
             "n_windows": value["windows"],
             "metrics": {name: dict(zip(KEYS, (np.array(sums) / value["windows"]).tolist(), strict=True))
                         for name, sums in zip(QUANTITIES, np.reshape(_sums(value), (-1, len(KEYS))), strict=True)}}
            for (model, truth), found in scored.items() for case, value in found if value["windows"]]


def prediction_clocks(body: Mapping[str, Any], recorded: str, labels: Mapping[str, int], seed: int = 0) -> None:
    """Compares rows of sysid.json on another clock with the same model as ``recorded``: ``clock_ratio`` {metric: {h}},
    ``clock_ratio_ci95``, ``clock_ratio_to``. From its ``per_flight``; a flight counts with its windows as recorded."""
    found: dict[tuple[str, str, str], dict[str, Mapping[str, Any]]] = {}
    for one in body.get("per_flight", ()):
        found.setdefault((one["model"], one["truth"], one["clock"]), {})[one["flight"]] = one
    for row in body["rows"]:
        ours, theirs = (found.get((row["model"], row["truth"], clock), {}) for clock in (row["clock"], recorded))
        names = [name for name, one in ours.items() if name in theirs and row["group"] in one["groups"]]
        if row["clock"] == recorded or row.get("start", "centred") != "centred" or not names:
            continue
        a, b = (np.array([[of[name]["metrics"][m][h] * theirs[name]["n_windows"] for m in QUANTITIES for h in KEYS]
                          for name in names]) for of in (ours, theirs))
        _add(row, paired_ratio(a, b, seed, [labels[name] for name in names]), recorded, "clock_ratio")


def gates(rows: Sequence[Mapping[str, Any]], recorded: Sequence[Mapping[str, Any]], labels: Mapping[str, int],
          seed: int = 0) -> dict[str, dict[str, Any]]:
    """{what: {ratio, ci95, n, mean, mean_recorded}} of the gate on another clock over the same flights as
    ``recorded``: path gap, how far lag and RMSE ratio are off, and the share of flights that fail."""
    ours, theirs = ({row["flight"]: _gate_errors(row) for row in found} for found in (rows, recorded))
    names = [name for name in ours if name in theirs]
    if not names:
        return {}
    a, b = (np.array([list(of[name].values()) for name in names], float) for of in (ours, theirs))
    found = paired_ratio(a, b, seed, [labels[name] for name in names])
    return {what: {**one, "mean": float(a[:, k].mean()), "mean_recorded": float(b[:, k].mean())}
            for k, (what, one) in enumerate(zip(ours[names[0]], found, strict=True))}


def _gate_errors(row: Mapping[str, Any]) -> dict[str, float]:
    return {"path_gap_m": row["path_gap_m"], "lag_off_s": abs(row["lag_diff_s"]),
            "rmse_ratio_off": abs(row["ratio"] - 1.0), "failed_share": float(not row["pass"])}


def _add(row: dict[str, Any], found: Sequence[Mapping[str, Any]], to: str, prefix: str) -> None:
    for key, what in ((prefix, "ratio"), (f"{prefix}_ci95", "ci95")):
        values = iter(found)
        row[key] = {name: {h: next(values)[what] for h in KEYS} for name in QUANTITIES}
    row[f"{prefix}_to"] = to


def _of_group(case: Any, value: Mapping[str, Any], group: str) -> Mapping[str, Any] | None:
    found = value if group in case.groups else value["battery"].get(group)
    return found if found and found["windows"] else None


def _sums(value: Mapping[str, Any]) -> list[float]:
    return [x for name in QUANTITIES for x in (*(value["sums"][name][h - 1] for h in HORIZONS),
                                               sum(value["sums"][name]))]


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

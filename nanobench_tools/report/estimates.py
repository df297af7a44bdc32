"""Pictures of Task 3 as plain data for the page's script: three standard deviations, dead logs, attribution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .row_cells import AS_RECORDED, clock_of
from .tables import Score


def pictures(estimate: Mapping[str, Any] | None) -> dict[str, dict[str, Any]]:
    """By name of the figure; an absent one says why."""
    body = estimate or {}
    return {"bands": bands(body), "deadlogs": dead_logs(body), "attribution": attribution(body)}


def bands(body: Mapping[str, Any]) -> dict[str, Any]:
    """sets: of one flight, or of one window without poses, the methods [{name, t, and for x, y, z truth, error and sd
    in m, cxy m^2}]."""
    sets = []
    found = [band for band in body.get("bands") or [] if band.get("t_s")]
    for name, clock in dict.fromkeys((str(band.get("name")), clock_of(band)) for band in found):
        mine = [band for band in found if (str(band.get("name")), clock_of(band)) == (name, clock)]
        sets.append({"name": name if clock == AS_RECORDED else f"{name}, clock {clock}",
                     "methods": [{"name": str(band["method"]), "t": band["t_s"], "cxy": band["cov_xy_m2"],
                                  **{key: _axes(band[f"{key}_m"]) for key in ("truth", "error", "sd")}}
                                 for band in mine]})
    return {"sets": sets} if sets else {
        "absent": "No estimate of this run says how sure it is; nanobench estimate --protocol aided has rows that do."}


def dead_logs(body: Mapping[str, Any]) -> dict[str, Any]:
    """flights: distance of the logged estimate [mm] over time, while its log lived and after it had ended."""
    found = body.get("dead_logs") or []
    if not found:
        return {"absent": "In no recording of the published protocol had the estimator's log ended in the air."}
    flights = []
    for one in found:
        t, mm = np.array(one["t_s"], float), 1e3 * np.array(one["error_m"], float)
        dead = np.zeros(len(t), bool)
        for start, end in one["dead"]:
            dead |= (t >= start) & (t <= end)
        flights.append({"name": str(one["flight"]), "t": t.tolist(), "all_mm": 1e3 * one["all_rmse_m"],
                        "live_mm": None if one["live_rmse_m"] is None else 1e3 * one["live_rmse_m"],
                        "live": [None if off else round(v, 2) for off, v in zip(dead, mm, strict=True)],
                        "dead": [round(v, 2) if off else None for off, v in zip(dead, mm, strict=True)]})
    return {"flights": flights}


def attribution(body: Mapping[str, Any]) -> dict[str, Any]:
    """bars: [{name, part, mm, low, high}]; ``part`` 0: ATE of the logged estimate by clock, 1: by how much one change
    moves the ATE of the replayed filter."""
    found = body.get("attribution")
    if not found:
        return {"absent": "This run does not say what the onboard filter's error comes from; nanobench estimate "
                          "--attribution does."}
    rows = [(0, f"logged, clock {row['what']}", row["metrics"].get("ate_m")) for row in found["logged"]]
    replayed = found["replayed"]
    rows += [(0, str(row["what"]), row["metrics"].get("ate_m")) for row in replayed[:1]]
    rows += [(1, str(row["what"]), row["metrics"].get("change_m")) for row in replayed[1:]]
    bars = []
    for part, name, metric in rows:
        score = Score.of(metric)
        if score.mean is not None:
            low, high = (score.mean if edge is None else edge for edge in (score.low, score.high))
            bars.append({"part": part, "name": name, "mm": 1e3 * score.mean, "low": 1e3 * low, "high": 1e3 * high})
    return {"bars": bars, "n": found["n"], "n_replayed": found["n_replayed"]}


def _axes(rows: Sequence[Sequence[float]]) -> dict[str, list[float]]:
    return {axis: [row[k] for row in rows] for k, axis in enumerate("xyz")}

"""Pictures of Task 2 as plain data for the page's script: single flights, error against speed, ranking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .quantities import number

EVERY = 2
"""Every so many samples of a simulated flight (20 Hz) are drawn."""
PANELS = (("rmse_m", "RMSE"), ("contour_rmse_m", "distance to the path, RMS"), ("worst_decile_m", "worst decile"))


def pictures(control: Mapping[str, Any] | None) -> dict[str, dict[str, Any]]:
    """By name of the figure; an absent one says why."""
    body = control or {}
    simulated = [row for row in body.get("rows") or [] if row.get("plant") == "simulated"]
    return {"gateflights": gate_flights(body), "race": race(body, simulated), "speeds": speeds(simulated),
            "ranking": ranking(simulated, body.get("error_bar")), "solver": solver(body.get("solve_times"))}


def gate_flights(body: Mapping[str, Any]) -> dict[str, Any]:
    """Recorded and simulated flights of a recording along its setpoints; the recording says whether it is real."""
    sets = [{"name": f"{f['flight']} ({f['controller']})", "time_s": f["time_s"], "reference": _axes(f["reference_m"]),
             "flights": [{"name": name, **_axes(f[key]), "error": _away(f[key], f["reference_m"])}
                         for name, key in ((_recorded(f, body), "real_m"), ("simulated", "simulated_m"))]}
            for f in body.get("gate_flights") or []]
    return {"sets": sets} if sets else {"absent": "No flight was flown again on the plant in this run."}


def race(body: Mapping[str, Any], simulated: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Every controller on the median plant along the same path, at the highest speed of each."""
    flights = body.get("flights") or []
    if not simulated or not flights:
        return {"absent": "No simulated flights in this run; nanobench control --plant simulated makes them."}
    sets = []
    for reference in dict.fromkeys(f["reference"] for f in flights):
        mine = [f for f in flights if f["reference"] == reference]
        fastest = max(f["speed_m_s"] or 0.0 for f in mine)
        mine = [f for f in mine if (f["speed_m_s"] or 0.0) == fastest]
        goal = np.array(mine[0]["reference_m"], float)[::EVERY]
        speed = f", {fastest:g} m/s" if fastest else ""
        sets.append({"name": f"{reference}{speed}", "time_s": mine[0]["time_s"][::EVERY], "reference": _axes(goal),
                     "flights": [{"name": f["controller"], **_axes(np.array(f["flown_m"], float)[::EVERY]),
                                  "error": [round(e, 4) for e in f["error_m"][::EVERY]]} for f in mine]})
    return {"sets": sets}


def speeds(simulated: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Median over the families flown at a speed, for every controller; least and largest family as a bar."""
    panels: list[dict[str, Any]] = []
    rows = [row for row in simulated if row.get("speed_m_s")]
    families = _in_all(rows)
    for key, title in PANELS:
        lines = []
        for name in dict.fromkeys(row["controller"] for row in rows):
            found: dict[float, list[float]] = {}
            for row in rows:
                value = number(row["metrics"].get(key))
                if row["controller"] == name and row["reference"] in families and value:
                    found.setdefault(float(row["speed_m_s"]), []).append(value)
            if found:
                at = sorted(found)
                low, middle, high = (np.array([np.quantile(found[v], q) for v in at]).tolist() for q in (0.0, 0.5, 1.0))
                lines.append({"name": name, "published": False, "x": at, "y": middle, "low": low, "high": high})
        if lines:
            panels.append({"title": title, "unit": "m", "lines": lines})
    if not panels or max(len(line["x"]) for line in panels[0]["lines"]) < 2:
        return {"absent": "Simulated flights at one speed only, so there is nothing to draw against it."}
    return {"panels": panels, "families": sorted(families)}


def _in_all(rows: Sequence[Mapping[str, Any]]) -> set[str]:
    """Families that every speed has: others would make one speed harder than the other."""
    by_speed: dict[float, set[str]] = {}
    for row in rows:
        by_speed.setdefault(float(row["speed_m_s"]), set()).add(row["reference"])
    return set.intersection(*by_speed.values()) if by_speed else set()


def ranking(simulated: Sequence[Mapping[str, Any]], bar: Mapping[str, Any] | None) -> dict[str, Any]:
    """Median RMSE over all references by controller, the best first, and how far off by the gate."""
    found = []
    for name in dict.fromkeys(row["controller"] for row in simulated):
        mine = [row for row in simulated if row["controller"] == name]
        values = [number(row["metrics"].get("rmse_m")) for row in mine]
        worst = [number(row["metrics"].get("worst_decile_m")) for row in mine]
        if any(v is None for v in values):
            continue
        middle = float(np.median(np.array(values, float)))
        share = float(bar["rmse_share_p90"]) if bar else 0.0
        found.append({"name": name, "cm": 100.0 * middle, "off": 100.0 * middle * share,
                      "worst": 100.0 * max((w for w in worst if w is not None), default=middle),
                      "lost": float(np.mean([row["metrics"].get("lost_percent") or 0.0 for row in mine]))})
    if not found:
        return {"absent": "No simulated flights in this run."}
    return {"rows": sorted(found, key=lambda one: one["cm"]), "bar": bool(bar)}


def solver(times: Sequence[Mapping[str, Any]] | None) -> dict[str, Any]:
    """How many per cent of the commands of every controller took how long, on a logarithmic scale."""
    lines = []
    for one in times or []:
        counts, edges = np.array(one["counts"], float), np.array(one["edges_ms"], float)
        used = np.flatnonzero(counts)
        if not len(used):
            continue
        rows = slice(max(used[0] - 1, 0), used[-1] + 2)
        lines.append({"name": one["controller"], "ms": np.sqrt(edges[:-1] * edges[1:])[rows].round(6).tolist(),
                      "percent": (100.0 * counts / counts.sum())[rows].round(3).tolist()})
    return {"lines": lines} if lines else {"absent": "No simulated flights in this run."}


def _recorded(flight: Mapping[str, Any], body: Mapping[str, Any]) -> str:
    """Of a result from before recordings were labelled one by one, the label of all."""
    return "SYNTHETIC recording" if flight.get("synthetic", body.get("synthetic")) else "real"


def _axes(points: Any) -> dict[str, list[float]]:
    table = np.round(np.asarray(points, float), 3)
    return {axis: table[:, i].tolist() for i, axis in enumerate("xyz")}


def _away(points: Any, goal: Any) -> list[float]:
    away = np.linalg.norm(np.asarray(points, float) - np.asarray(goal, float), axis=1)
    return list(np.round(away, 4).tolist())

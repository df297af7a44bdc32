"""Pictures of Task 2: single flights on the plant, error against speed, ranking, solver times."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..tables.quantities import number
from .figure import Axis, Choice, Drawing, Figure, Mark, Panel, intervals, styled
from .overview_pictures import curves
from .packed import rounded

EVERY = 2
"""Every so many samples of a simulated flight (20 Hz) are drawn."""
PANELS = (("rmse_m", "RMSE"), ("contour_rmse_m", "distance to the path, RMS"), ("worst_decile_m", "worst decile"))
LEAST_M = 1e-3
"""Least error that a logarithmic axis shows."""


def pictures(control: Mapping[str, Any] | None) -> dict[str, Drawing | None]:
    """By name of the figure."""
    body = control or {}
    simulated = [row for row in body.get("rows") or [] if row.get("plant") == "simulated"]
    return {"gateflights": gate_flights(body), "race": race(body, simulated), "speeds": speeds(simulated),
            "ranking": ranking(simulated, body.get("error_bar")), "solver": solver(body.get("solve_times"))}


def _flown(title: str, note: str, time_s: Sequence[float], reference: np.ndarray,
           flown: Mapping[str, np.ndarray]) -> Figure:
    """Flights (n, 3) [m] along a reference (n, 3) [m]: from above, and distance and height over time."""
    t = np.asarray(time_s, float)
    style = {"reference": {"colour": "ink", "dash": "dot"}, **styled(list(flown), symbols=False)}
    above, away, height = [], [], []
    for name, path in {"reference": reference, **flown}.items():
        x, y, z = (rounded(path[:, k], 1e-3) for k in range(3))
        above.append(Mark(name, x, y, t=t, **style[name]))
        height.append(Mark(name, t, z, **style[name]))
        if name != "reference":
            error = np.linalg.norm(path - reference, axis=1)
            away.append(Mark(name, t, rounded(np.maximum(error, LEAST_M), LEAST_M), **style[name]))
    low, high = reference[:, 2].min(), reference[:, 2].max()
    return Figure(title, note, [
        Panel(Axis("x", "m"), Axis("y", "m"), above, "from above", 420, equal=True),
        Panel(Axis("time", "s"), Axis("error", "m", log=True), away, "distance to the reference", 420, timed=True),
        Panel(Axis("time", "s"), Axis("height", "m", range=(low - 0.35, high + 0.35)), height, "", 200, wide=True,
              timed=True)], cursor=(float(time_s[0]), float(time_s[-1])))


def gate_flights(body: Mapping[str, Any]) -> Drawing | None:
    """Recorded and simulated flights of a recording along its set-points."""
    note = ("The recorded flight and the one simulated with the same set-points and battery. Of each onboard "
            "controller the flight with the median gap, and the one with the largest.")
    sets: dict[tuple[str, ...], Figure] = {(f"{f['flight']} ({f['controller']})",): _flown(
        "A recording flown again on the plant", note, f["time_s"], _xyz(f["reference_m"]),
        {_recorded(f, body): _xyz(f["real_m"]), "simulated": _xyz(f["simulated_m"])})
        for f in body.get("gate_flights") or []}
    return Choice(("Flight",), sets) if sets else None


def race(body: Mapping[str, Any], simulated: Sequence[Mapping[str, Any]]) -> Drawing | None:
    """Every controller on the median plant along the same path, at the highest speed of each."""
    flights = body.get("flights") or []
    if not simulated or not flights:
        return None
    sets: dict[tuple[str, ...], Figure] = {}
    for reference in dict.fromkeys(f["reference"] for f in flights):
        mine = [f for f in flights if f["reference"] == reference]
        fastest = max(f["speed_m_s"] or 0.0 for f in mine)
        mine = [f for f in mine if (f["speed_m_s"] or 0.0) == fastest]
        speed = f", {fastest:g} m/s" if fastest else ""
        sets[(f"{reference}{speed}",)] = _flown(
            "Controllers on the same path, simulated",
            "The median plant at the highest speed; the path begins at full speed, and what is flown in its first 3 s "
            "is not scored.", mine[0]["time_s"][::EVERY], _xyz(mine[0]["reference_m"])[::EVERY],
            {f["controller"]: _xyz(f["flown_m"])[::EVERY] for f in mine})
    return Choice(("Path",), sets)


def speeds(simulated: Sequence[Mapping[str, Any]]) -> Figure | None:
    """Median over the trajectories flown at a speed, for every controller; least and largest as a bar."""
    rows = [row for row in simulated if row.get("speed_m_s")]
    families = _in_all(rows)
    names = list(dict.fromkeys(row["controller"] for row in rows))
    style = styled(names)
    panels = []
    for key, title in PANELS:
        lines = []
        for name in names:
            found: dict[float, list[float]] = {}
            for row in rows:
                value = number(row["metrics"].get(key))
                if row["controller"] == name and row["reference"] in families and value:
                    found.setdefault(float(row["speed_m_s"]), []).append(value)
            if len(found) > 1:
                at = sorted(found)
                low, middle, high = (np.array([np.quantile(found[v], q) for v in at]).tolist() for q in (0.0, 0.5, 1.0))
                lines.append((name, at, middle, low, high))
        if lines:
            panels.append(curves(title, "m", Axis("speed", "m/s", log=True), lines, style))
    return Figure("Error against speed, simulated",
                  f"Median over the trajectories flown at every speed ({', '.join(sorted(families))}), each the median "
                  "over plants; bars: best and worst of them.", panels) if panels else None


def _in_all(rows: Sequence[Mapping[str, Any]]) -> set[str]:
    """Trajectories that every speed has: others would make one speed harder than the other."""
    by_speed: dict[float, set[str]] = {}
    for row in rows:
        by_speed.setdefault(float(row["speed_m_s"]), set()).add(row["reference"])
    return set.intersection(*by_speed.values()) if by_speed else set()


def ranking(simulated: Sequence[Mapping[str, Any]], bar: Mapping[str, Any] | None) -> Figure | None:
    """Median RMSE over all references by controller, the best first, and how far off by the gate."""
    found = []
    for name in dict.fromkeys(row["controller"] for row in simulated):
        mine = [row for row in simulated if row["controller"] == name]
        values = [number(row["metrics"].get("rmse_m")) for row in mine]
        worst = [number(row["metrics"].get("worst_decile_m")) for row in mine]
        if any(v is None for v in values):
            continue
        middle = 100.0 * float(np.median(np.array(values, float)))
        off = middle * (float(bar["rmse_share_p90"]) if bar else 0.0)
        found.append((middle, max(middle - off, 0.05 * middle), middle + off,
                      100.0 * max((w for w in worst if w is not None), default=middle / 100.0), name))
    if not found:
        return None
    medians, low, high, most, names = (list(v) for v in zip(*sorted(found), strict=True))
    note = "Median over references, each the median over plants"
    note += ", with the error that one flight in ten of the gate exceeds" if bar else ""
    return Figure("Controllers over all references, simulated",
                  f"{note}; red: the reference with the largest worst decile.",
                  [intervals("RMSE", "cm", names, {"median over references": (medians, low, high),
                                                   "largest worst decile": (most, most, most)}, log=True)])


def solver(times: Sequence[Mapping[str, Any]] | None) -> Figure | None:
    """How long each controller takes for a command: share of commands [%] over wall-clock time [ms]."""
    found = []
    for one in times or []:
        counts, edges = np.array(one["counts"], float), np.array(one["edges_ms"], float)
        used = np.flatnonzero(counts)
        if len(used):
            rows = slice(max(used[0] - 1, 0), used[-1] + 2)
            found.append((str(one["controller"]), np.sqrt(edges[:-1] * edges[1:])[rows],
                          (100.0 * counts / counts.sum())[rows]))
    if not found:
        return None
    style = styled([name for name, *_ in found], symbols=False)
    marks = [Mark(name, time_ms, share, **style[name]) for name, time_ms, share in found]
    return Figure("How long controllers take for a command",
                  "Share of all commands by wall-clock time on the machine of this run, mean over vehicles that fly "
                  "together. A period is 2 ms for controllers that fly on board and 10 ms for predictive ones.",
                  [Panel(Axis("time of a command", "ms", log=True), Axis("share", "%", zero=True), marks, height=340,
                         wide=True)])


def _recorded(flight: Mapping[str, Any], body: Mapping[str, Any]) -> str:
    """Of a result from before recordings were labelled one by one, the label of all."""
    return "SYNTHETIC recording" if flight.get("synthetic", body.get("synthetic")) else "recorded"


def _xyz(rows: Sequence[Sequence[float]]) -> np.ndarray:
    return np.array(rows, float)

"""The pictures over all recordings; None where the results hold nothing to draw."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..protocols.scoring3 import PROGRESS
from ..tables.quantities import number, shown
from ..tables.result_table import Score
from .audit_entry import CLOCK_STREAMS, total
from .figure import Axis, Figure, Mark, Panel, styled
from .row_cells import AS_RECORDED, PUBLISHED, SPEEDS, SYSID_METRICS, clock_of, of_one_clock, one_truth
from .task3_tables import CORRECTED

STEP_S = 0.01
"""One step of a Task 1 horizon."""
SHOWN_FLIGHTS = 24
"""Rows of the first picture; a longer list is a table's."""
SEVERITIES = ("unusable", "cut", "minor", "fine")
GOLDEN = 0.618034

Line = tuple[str, list[float], list[float], list[float], list[float]]
"""Name, x, and value with lower and upper end at each."""


def curves(title: str, unit: str, x: Axis, lines: Sequence[Line], style: Mapping[str, Mapping[str, Any]]) -> Panel:
    """Values with intervals over ``x``, both axes logarithmic."""
    marks = [Mark(name, at, middle, "both", low=low, high=high, **style[name]) for name, at, middle, low, high in lines]
    return Panel(x, Axis(title, unit, log=True), marks, height=300)


def flights(audit: Mapping[str, Any] | None) -> Figure | None:
    """Usable and lost seconds of flight, a row each, the worst first."""
    entries = [f for f in (audit or {}).get("flights") or [] if f.get("usable") is not None]
    if not entries:
        return None
    lost = {f["flight"]: max(0.0, (total(f.get("airborne")) or 0.0) - (total(f["usable"]) or 0.0)) for f in entries}
    worst = sorted(entries, key=lambda f: (SEVERITIES.index(f["severity"]), -lost[f["flight"]], f["flight"]))
    rows = worst[:SHOWN_FLIGHTS]
    at = [float(i) for i in range(len(rows))]
    usable = [total(f["usable"]) or 0.0 for f in rows]
    said = [f["verdict"] for f in rows]
    marks = [Mark("usable", [0.0] * len(rows), at, "bars", "green", size=0.7, high=usable, text=said),
             Mark("in the air, not usable", usable, at, "bars", "red", size=0.7, text=said,
                  high=[u + lost[f["flight"]] for u, f in zip(usable, rows, strict=True)])]
    more = len(entries) - len(rows)
    return Figure("How much of each flight can be used", "The worst first."
                  + (f" {more} better ones are in the table below." if more else ""),
                  [Panel(Axis("flight", "s", zero=True), Axis(rows=[f["flight"] for f in rows]), marks,
                         height=70 + 17 * len(rows), wide=True)])


def task1(sysid: Mapping[str, Any] | None, published: bool) -> Figure | None:
    """Mean error over horizon, a panel per quantity, a line per model; ``published`` values as separate lines."""
    rows = one_truth(of_one_clock(r for r in (sysid or {}).get("rows") or [] if r.get("group", "all") == "all"))
    names = list(dict.fromkeys(str(row.get("model")) for row in rows))
    style = styled(names)
    style.update({f"{name}, published": {**style[name], "dash": "dot", "symbol": f"{style[name]['symbol']}-open"}
                  for name in names})
    found: dict[str, list[Line]] = {}
    for metric in SYSID_METRICS:
        for row in rows:
            for name, body in ((str(row.get("model")), row.get("metrics")),
                               (f"{row.get('model')}, published", row.get("published") if published else None)):
                theirs = name.endswith(", published")
                intervals = {} if theirs else (row.get("ci95") or {}).get(metric) or {}
                values = {h: v for h, v in ((body or {}).get(metric) or {}).items() if str(h).isdigit()}
                if not theirs and (curve := (row.get("curve") or {}).get(metric)):
                    every = {str(h): v for h, v in enumerate(curve, start=1) if h % 5 == 0 or h < 5}
                    values = every | values
                points = sorted((int(h), Score.of(v, intervals.get(h))) for h, v in values.items() if number(
                    v.get("mean") if isinstance(v, Mapping) else v))
                if points:
                    found.setdefault(metric, []).append(_line(name, [(h * STEP_S, s) for h, s in points]))
    if not found:
        return None
    x = Axis("horizon", "s", log=True)
    panels = [curves(shown(metric).title, shown(metric).unit, x, lines, style) for metric, lines in found.items()]
    truth, clock = rows[0].get("truth"), clock_of(rows[0])
    against = "the onboard estimate" if truth in (None, "onboard") else f"{truth} truth"
    return Figure("Prediction: error over horizon",
                  f"Mean over windows with 95 % interval; attitude against {against}; clock {clock}."
                  + (" Dotted with open marks: published values." if published else ""), panels)


def _line(name: str, points: Iterable[tuple[float, Score]]) -> Line:
    line: Line = (name, [], [], [], [])
    for x, score in points:
        if score.mean is not None and score.mean > 0:
            for values, value in zip(line[1:], (x, score.mean, score.low, score.high), strict=True):
                values.append(score.mean if value is None else value)
    return line


def _ends(score: Score, factor: float) -> tuple[float, float, float]:
    """Value, lower and upper end, which are the value where there is no interval."""
    middle = score.mean or 0.0
    low, high = (middle if end is None else end for end in (score.low, score.high))
    return factor * middle, factor * low, factor * high


def by_speed(estimate: Mapping[str, Any] | None) -> Figure | None:
    """ATE of every recording by speed, by the published protocol and corrected."""
    body = {key: [entry for entry in (estimate or {}).get(key) or [] if clock_of(entry) == AS_RECORDED]
            for key in ("rows", "per_flight")}
    corrected = CORRECTED if any(r.get("protocol") == CORRECTED for r in body["rows"]) else "clean"
    method = next((r.get("method") for r in body["rows"] if r.get("protocol") == PUBLISHED), None)
    groups: dict[str, list[Any]] = {}
    for item in body["per_flight"]:
        groups.setdefault(str(item.get("speed") or item.get("group") or "other").lower(), []).append(item)
    names = [g for g in (*SPEEDS, "other") if g in groups]
    marks = []
    for side, (protocol, name, colour, symbol) in ((-1, (PUBLISHED, "as published", "red", "square")),
                                                   (1, (corrected, "corrected", "blue", "circle"))):
        points = [(names.index(group), item["flight"], 1e3 * value) for group in names for item in groups[group]
                  if item.get("protocol") == protocol and item.get("method") == method
                  and (value := number((item.get("metrics") or {}).get("ate_rmse_m")))]
        means = [(names.index(group), *_ends(score, 1e3)) for row in body["rows"] if row.get("protocol") == protocol
                 and row.get("method") == method and (group := str(row.get("group")).lower()) in names
                 and (score := Score.of((row.get("metrics") or {}).get("ate_rmse_m"))).mean]
        if not points:
            return None
        spread = [at + side * (0.12 + 0.22 * (k * GOLDEN % 1.0)) for k, (at, *_) in enumerate(points)]
        marks += [Mark(f"{name}, each recording", spread, [mm for *_, mm in points], "points", colour, symbol=symbol,
                       fade=[0.6] * len(points), size=7, text=[f"{f}: {mm:.1f} mm" for _, f, mm in points]),
                  Mark(f"{name}, mean", [at + 0.1 * side for at, *_ in means], [m[1] for m in means], "points", colour,
                       symbol=f"{symbol}-open", size=13, low=[m[2] for m in means], high=[m[3] for m in means])]
    return Figure("Position error by speed: published protocol and corrected",
                  f"{method}: ATE RMSE after alignment, of each recording, and the mean with its 95 % interval.",
                  [Panel(Axis("speed", rows=names), Axis("ATE RMSE", "mm", log=True), marks, height=420, wide=True)])


def progress(estimate: Mapping[str, Any] | None) -> Figure | None:
    """Position error over the share of the flight, and velocity residuals by axis, by speed: mean and SD over
    flights."""
    rows = [row for row in (estimate or {}).get("rows") or [] if row.get("protocol") == "clean"
            and clock_of(row) == AS_RECORDED and str(row.get("group")).lower() in (*SPEEDS, "all")]
    method = next((row.get("method") for row in rows), None)
    rows = [row for row in rows if row.get("method") == method]
    names = [str(row["group"]) for row in rows if len(rows) == 1 or str(row["group"]).lower() in SPEEDS]
    style = styled(names)
    lines: list[Mark] = []
    residuals: list[Mark] = []
    for name in names:
        metrics = next(row["metrics"] for row in rows if str(row["group"]) == name)
        at = [k for k in range(10, 101, 10) if (metrics.get(PROGRESS.format(k)) or {}).get("mean") is not None]
        found = [(1e3 * metrics[PROGRESS.format(k)]["mean"], 1e3 * (metrics[PROGRESS.format(k)]["std"] or 0.0))
                 for k in at]
        if found:
            lines.append(Mark(name, [float(k) for k in at], [m for m, _ in found], "both",
                              low=[max(m - sd, 0.0) for m, sd in found], high=[m + sd for m, sd in found],
                              **style[name]))
        axes = [Score.of(metrics.get(f"velocity_{a}_rmse_m_s")).mean for a in "xyz"]
        if None not in axes:
            residuals.append(Mark(name, [0.0, 1.0, 2.0], axes, "both", **style[name]))
    if not lines:
        return None
    panels = [Panel(Axis("share of the flight", "%", range=(0.0, 105.0)), Axis("position error", "mm", zero=True),
                    lines, "position error, not aligned", 300)]
    if residuals:
        panels.append(Panel(Axis("axis of the world", rows=["x", "y", "z"]), Axis("velocity RMSE", "m/s", zero=True),
                            residuals, "velocity residuals", 300))
    return Figure("Error over the progress of the flight",
                  f"{method}: mean and standard deviation over the flights of a speed, in each tenth of the scored "
                  "time. The velocity residuals are estimate less motion capture.", panels)


def blackout(estimate: Mapping[str, Any] | None) -> Figure | None:
    """End error over the time since the last pose, as recorded, for every method. Also the share of errors inside
    three standard deviations of the method's own covariance."""
    windows = [w for w in (estimate or {}).get("windows") or [] if clock_of(w) == AS_RECORDED]
    methods = list(dict.fromkeys(str(w.get("method")) for w in windows))
    style = styled(methods)
    x = Axis("time since the last pose", "s", log=True)
    kinds = {"3-D error": ("error_m", "m"), "horizontal error": ("horizontal_m", "m"),
             "vertical error": ("vertical_m", "m"), "drift, of the path flown": ("drift_percent", "%")}
    panels = []
    for title, (key, unit) in kinds.items():
        lines = []
        for method in methods:
            found: dict[float, list[float]] = {}
            for window in windows:
                if str(window.get("method")) == method and (value := number(window.get(key))):
                    found.setdefault(float(window["h_s"]), []).append(value)
            if found:
                at = sorted(found)
                low, middle, high = (np.array([np.percentile(found[h], q) for h in at]).tolist() for q in (25, 50, 75))
                lines.append((method, at, middle, low, high))
        if lines:
            panels.append(curves(title, unit, x, lines, style))
    inside = []
    for method in methods:
        within = [(float(w["h_s"]), bool(w["inside_3_sigma"])) for w in windows
                  if str(w.get("method")) == method and w.get("inside_3_sigma") is not None]
        if within:
            at = sorted({h for h, _ in within})
            share = [100.0 * float(np.mean([yes for h, yes in within if h == here])) for here in at]
            inside.append(Mark(method, at, share, "both", **style[method]))
    if inside:
        panels.append(Panel(x, Axis("inside 3 sigma", "%", range=(0.0, 103.0)), inside, height=300,
                            rules=[("y", 99.7)]))
    if not panels:
        return None
    return Figure("Error since the poses stopped",
                  "Median and quartiles over the windows of all flights, as recorded. Inside 3 sigma: "
                  "share of the errors within three standard deviations that an estimator reports; 99.7 % would be "
                  "right.", panels)


def clocks(audit: Mapping[str, Any] | None) -> Figure | None:
    """Clock offset of every recording against motion capture with its 95 % interval [ms]."""
    found = (audit or {}).get("flights") or []
    streams = [s for s in CLOCK_STREAMS if any(s in (f.get("clock") or {}) for f in found)]
    if not streams:
        return None
    names, values, unknown = [], [], []
    for flight in found:
        clock = (flight.get("clock") or {}).get(streams[0]) or {}
        offset, interval = number(clock.get("offset_s")), clock.get("ci95_s")
        if offset is None or not clock.get("identifiable", True):
            unknown.append(flight["flight"])
            continue
        names.append(flight["flight"])
        values.append([1e3 * v for v in (offset, *(interval or (offset, offset)))])
    if not names:
        return None
    value, low, high = (list(v) for v in zip(*values, strict=True))
    mark = Mark("clock offset", value, [float(i) for i in range(len(names))], "points", low=low, high=high,
                across=True, size=7, text=[f"{n}: {v:.1f} ms" for n, v in zip(names, value, strict=True)])
    note = f"Positive: timestamps of the {streams[0]} stream are late. Bars: 95 % interval of the constant offset."
    if unknown:
        note += f" Not identifiable: {', '.join(unknown)}."
    return Figure("Clock offset against motion capture", note,
                  [Panel(Axis("clock offset", "ms", zero=True), Axis(rows=names), [mark], height=70 + 15 * len(names),
                         wide=True)])

"""The pictures over all recordings, as plain data for the page's script; an absent one says why."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .audit_entry import CLOCK_STREAMS, fault_counts, share_clean, share_valid, streams_of, total
from .quantities import number, shown
from .row_cells import AS_RECORDED, PUBLISHED, SPEEDS, SYSID_METRICS, clock_of, of_one_clock, one_truth
from .tables import Score
from .task3_tables import CORRECTED

STEP_S = 0.01
"""One step of a Task 1 horizon."""


def task1(sysid: Mapping[str, Any] | None) -> dict[str, Any]:
    """Mean error over horizon, one panel per quantity, one line per model; published values as lines of their own."""
    rows = of_one_clock(r for r in (sysid or {}).get("rows") or [] if r.get("group", "all") == "all")
    rows = one_truth(rows)
    panels = []
    for metric in SYSID_METRICS:
        lines = []
        for row in rows:
            for name, body, published in ((str(row.get("model")), row.get("metrics"), False),
                                          (f"{row.get('model')}, published", row.get("published"), True)):
                intervals = {} if published else (row.get("ci95") or {}).get(metric) or {}
                values = {h: v for h, v in ((body or {}).get(metric) or {}).items() if str(h).isdigit()}
                if not published and (curve := (row.get("curve") or {}).get(metric)):
                    values = {str(h): v for h, v in enumerate(curve, start=1)} | values
                points = [(int(h), Score.of(v, intervals.get(h))) for h, v in values.items()]
                points = sorted((p for p in points if p[1].mean is not None and p[1].mean > 0), key=lambda p: p[0])
                if points:
                    lines.append({"name": name, "published": published, "x": [h * STEP_S for h, _ in points],
                                  "y": [s.mean for _, s in points],
                                  "low": [s.low if s.low is not None else s.mean for _, s in points],
                                  "high": [s.high if s.high is not None else s.mean for _, s in points]})
        if lines:
            how = shown(metric)
            panels.append({"title": how.title, "unit": how.unit, "lines": lines})
    if not panels:
        return {"absent": "No Task 1 results to draw."}
    return {"panels": panels, "truth": rows[0].get("truth"), "clock": clock_of(rows[0])}


def task3(estimate: Mapping[str, Any] | None, first: str = "as published") -> dict[str, Any]:
    """ATE of every recording by speed, as published (called ``first``) and corrected; means with intervals where only
    these are known."""
    body = estimate or {}
    body = {key: [entry for entry in body.get(key) or [] if clock_of(entry) == AS_RECORDED]
            for key in ("rows", "per_flight")}
    protocols = {r.get("protocol") for r in body.get("rows") or []}
    corrected = CORRECTED if CORRECTED in protocols else "clean"
    method = next((r.get("method") for r in body.get("rows") or [] if r.get("protocol") == PUBLISHED), None)
    sets: list[dict[str, Any]] = []
    for protocol, name in ((PUBLISHED, first), (corrected, "corrected")):
        points, means = [], []
        for item in body.get("per_flight") or []:
            value = number((item.get("metrics") or {}).get("ate_rmse_m"))
            if item.get("protocol") == protocol and item.get("method") == method and value:
                group = str(item.get("speed") or item.get("group") or "other").lower()
                points.append({"group": group, "flight": str(item.get("flight")), "mm": 1e3 * value})
        for row in body.get("rows") or []:
            score = Score.of((row.get("metrics") or {}).get("ate_rmse_m"))
            group = str(row.get("group")).lower()
            if row.get("protocol") == protocol and row.get("method") == method and score.mean and group in SPEEDS:
                means.append({"group": group, "mm": 1e3 * score.mean, "low": _mm(score.low), "high": _mm(score.high)})
        if points or means:
            sets.append({"name": name, "points": points, "means": means})
    if len(sets) < 2:
        return {"absent": "The published and the corrected protocol are not both among the results, so there is "
                          "nothing to draw side by side."}
    groups = {p["group"] for s in sets for kind in ("points", "means") for p in s[kind]}
    return {"method": method, "groups": [g for g in (*SPEEDS, "other") if g in groups], "sets": sets}


def blackout(estimate: Mapping[str, Any] | None) -> dict[str, Any]:
    """End error over the time since the poses stopped, as recorded: a panel each for 3-D, horizontal and vertical and
    for the drift in % of the path, with median and quartiles over the windows of all flights for every method; and how
    many of the errors are inside three standard deviations of what a method says of itself."""
    windows = [w for w in (estimate or {}).get("windows") or [] if clock_of(w) == AS_RECORDED]
    panels = []
    kinds = {"3-D error": ("error_m", "m"), "horizontal error": ("horizontal_m", "m"),
             "vertical error": ("vertical_m", "m"), "drift, of the path flown": ("drift_percent", "%")}
    for title, (key, unit) in kinds.items():
        lines = []
        for method in dict.fromkeys(str(w.get("method")) for w in windows):
            found: dict[float, list[float]] = {}
            for window in windows:
                if str(window.get("method")) == method and (value := number(window.get(key))):
                    found.setdefault(float(window["h_s"]), []).append(value)
            if found:
                at = sorted(found)
                low, middle, high = (np.array([np.percentile(found[h], q) for h in at]).tolist() for q in (25, 50, 75))
                lines.append({"name": method, "published": False, "x": at, "y": middle, "low": low, "high": high})
        if lines:
            panels.append({"title": title, "unit": unit, "lines": lines})
    inside = []
    for method in dict.fromkeys(str(w.get("method")) for w in windows):
        within = [(float(w["h_s"]), bool(w["inside_3_sigma"])) for w in windows
                if str(w.get("method")) == method and w.get("inside_3_sigma") is not None]
        if within:
            at = sorted({h for h, _ in within})
            share = [100.0 * float(np.mean([yes for h, yes in within if h == here])) for here in at]
            share = [max(v, 1.0) for v in share]  # the axis is logarithmic
            inside.append({"name": method, "published": False, "x": at, "y": share, "low": share, "high": share})
    if inside:
        panels.append({"title": "inside 3 sigma", "unit": "%", "lines": inside})
    if not panels:
        return {"absent": "No dead reckoning after the poses stopped among the results."}
    return {"panels": panels}


def _mm(value: float | None) -> float | None:
    return None if value is None else 1e3 * value


def clocks(audit: Mapping[str, Any] | None) -> dict[str, Any]:
    """Clock offset of every recording against motion capture with its 95 % interval [ms]."""
    flights = (audit or {}).get("flights") or []
    streams = [s for s in CLOCK_STREAMS if any(s in (f.get("clock") or {}) for f in flights)]
    if not streams:
        return {"absent": "No clock was compared with the motion capture."}
    stream = streams[0]
    rows, unknown = [], []
    for flight in flights:
        clock = (flight.get("clock") or {}).get(stream) or {}
        offset, interval = number(clock.get("offset_s")), clock.get("ci95_s")
        if offset is None or not clock.get("identifiable", True):
            unknown.append(flight["flight"])
            continue
        low, high = interval or (offset, offset)
        rows.append({"flight": flight["flight"], "ms": 1e3 * offset, "low": 1e3 * low, "high": 1e3 * high,
                     "wander": _mm(number(clock.get("wander_sd_s")))})
    if not rows:
        return {"absent": f"No clock offset of the {stream} stream is identifiable."}
    return {"stream": stream, "rows": rows, "unknown": unknown}


def fault_matrix(audit: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Recordings by streams: share of the time [%] in which nothing is known against the stream; None without audit.

    Each row: name, controller, length and airborne time [s], clean [%], cells in the order of ``streams`` (None where
    the recording has no such stream), faults by kind.
    """
    flights = (audit or {}).get("flights") or []
    if not flights:
        return None
    streams = streams_of(flights)
    rows = []
    for flight in flights:
        clean = share_clean(flight)
        rows.append({"name": flight["flight"], "controller": flight.get("controller"),
                     "length": total([flight["span"]]) if flight.get("span") else None,
                     "airborne": total(flight.get("airborne")), "clean": None if clean is None else 100 * clean,
                     "cells": [_percent(share_valid(flight, s)) if s in (flight.get("rates") or {}) else None
                               for s in streams],
                     "faults": fault_counts(flight)})
    return {"streams": streams, "rows": rows}


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share

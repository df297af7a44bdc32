"""One recording as the page draws it: paths, errors over time, the audit's timeline, battery and motors.

What is drawn and what was thinned out is said in the picture's caption; see ``decimate``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .. import so3
from ..faults.kinds import group_of, kinds
from ..flight import Flight, Span, Stream, mask_of
from .audit_entry import cut_spans, fault_counts, share_valid, span_of, streams_of, total
from .clock_error import clock_error
from .decimate import at_rate, extreme_rows, pack
from .quantities import DASH, format_number, number

PATH_RATE_HZ = 20.0
BUCKETS = 300
"""A series over time shows the extremes of this many stretches of the recording."""
LISTED_FAULTS = 40


def payload(flight: Flight, audit: Mapping[str, Any] | None,
            taken_out: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Everything the page draws of ``flight``; ``audit`` is its entry of audit.json, None when it was not audited,
    ``taken_out`` the clock error in estimate.json that the estimator is judged with."""
    audit = audit or {}
    airborne = [Span(*s) for s in audit.get("airborne") or []]
    return {
        "name": flight.name,
        "facts": facts(flight, audit),
        "span": [round(flight.span.start_s, 3), round(flight.span.end_s, 3)],
        "paths": paths(flight, audit, airborne),
        "errors": errors(flight, audit, airborne),
        "clock": clock_error(flight, audit, taken_out),
        "timeline": timeline(flight, audit),
        "battery": over_time(flight, audit, {"battery": {"vbat": "battery"}}, 5e-4),
        "motors": over_time(flight, audit, {"motor": {f"m{i}": f"motor {i}" for i in range(1, 9)}}, 1e-4),
        "faults": fault_list(audit),
        "streams": stream_list(flight, audit),
    }


def facts(flight: Flight, audit: Mapping[str, Any]) -> list[list[str]]:
    """Label and value of what is known of the recording as a whole."""
    sheet = flight.metadata
    speed = number(sheet.get("reference_speed_m_s"))
    found = {
        "Family": sheet.get("family"),
        "Speed": ", ".join(str(v) for v in (sheet.get("speed"), f"{speed:g} m/s" if speed else None) if v),
        "Controller": audit.get("controller"),
        "Length": f"{flight.span.duration_s:.1f} s",
        "Airborne": _seconds(audit.get("airborne")),
        "Clean": _seconds(audit.get("clean")),
        "Faults": ", ".join(f"{k} ×{n}" if n > 1 else k for k, n in fault_counts(audit).items()) if audit else None,
        "File": flight.provenance.path.replace("\\", "/").rsplit("/", 1)[-1],
        "SHA-256": flight.provenance.sha256[:12],
    }
    if audit and not found["Faults"]:
        found["Faults"] = "none"
    return [[label, str(value)] for label, value in found.items() if value]


def _seconds(spans: Any) -> str | None:
    seconds = total(spans)
    return None if seconds is None else f"{seconds:.1f} s"


def paths(flight: Flight, audit: Mapping[str, Any], airborne: Sequence[Span]) -> dict[str, Any]:
    """Motion capture, onboard estimate and setpoint in the world [m] at PATH_RATE_HZ; cut spans are gaps.

    The setpoint is drawn while the vehicle is airborne: before and after it is not a place to be at, and neither are
    the zeros that are logged once nothing is asked for.
    """
    series = []
    for stream, label, axes in (("mocap", "motion capture", ("px", "py", "pz")),
                                ("estimator", "onboard estimate", ("x", "y", "z")),
                                ("setpoint", "setpoint", ("x", "y", "z"))):
        if stream not in flight or not all(a in flight[stream] for a in axes) or not len(flight[stream]):
            continue
        source = flight[stream]
        rows = at_rate(source.time_s, PATH_RATE_HZ)
        time_s, points = source.time_s[rows], source[axes][rows].copy()
        points[mask_of(cut_spans(audit, stream), time_s)] = np.nan
        if stream == "setpoint" and airborne:
            points[~mask_of(airborne, time_s) | (points == 0.0).all(axis=1)] = np.nan
        if np.isfinite(points).any():
            series.append({"name": label, "key": stream, **{a: pack(points[:, i], 5e-4) for i, a in enumerate("xyz")}})
    if not series:
        return {"absent": "No stream of this recording holds a position."}
    return {"series": series, "rate_hz": PATH_RATE_HZ}


def errors(flight: Flight, audit: Mapping[str, Any], airborne: Sequence[Span]) -> dict[str, Any]:
    """Distance [mm] and angle [deg] between the onboard estimate and motion capture at the same stamps, not aligned."""
    if "mocap" not in flight or len(flight["mocap"]) < 2:
        return {"absent": "No motion capture in this recording, so there is no truth to compare with."}
    truth = _rising(flight["mocap"])
    series = []
    if "estimator" in flight and "x" in flight["estimator"] and "px" in truth:
        source = flight["estimator"]
        distance = np.linalg.norm(source["x", "y", "z"] - truth.interpolate(("px", "py", "pz"), source.time_s), axis=1)
        distance = _inside(1e3 * distance, source.time_s, truth)
        series.append(_series("position", "estimator", "mm", source.time_s, distance, audit, airborne, 0.05))
    if "attitude_qw" in flight and "qw" in flight["attitude_qw"] and "qw" in truth:
        source = flight["attitude_qw"]
        angle = np.degrees(so3.geodesic_angle(
            _unit(source["qx", "qy", "qz", "qw"]),
            so3.interpolate(truth.time_s, _unit(truth["qx", "qy", "qz", "qw"]), source.time_s)))
        angle = _inside(angle, source.time_s, truth)
        series.append(_series("attitude", "attitude_qw", "deg", source.time_s, angle, audit, airborne, 5e-3))
    return {"series": series} if series else {"absent": "No onboard estimate in this recording."}


def _rising(stream: Stream) -> Stream:
    """The rows at strictly rising stamps, so that they can be interpolated."""
    time_s = stream.time_s
    return stream.rows(np.r_[True, time_s[1:] > np.maximum.accumulate(time_s)[:-1]])


def _inside(values: np.ndarray, time_s: np.ndarray, truth: Stream) -> np.ndarray:
    """``values`` (n,) with a gap outside the time the truth covers."""
    return np.where(truth.span.mask(time_s), values, np.nan)


def _unit(quaternion: np.ndarray) -> np.ndarray:
    """(n, 4) made unit; what has no direction becomes the identity."""
    norm = np.linalg.norm(quaternion, axis=1, keepdims=True)
    good = np.isfinite(norm) & (norm > 1e-6)
    return np.where(good, quaternion / np.where(good, norm, 1.0), [0.0, 0.0, 0.0, 1.0])


def _series(name: str, stream: str, unit: str, time_s: np.ndarray, values: np.ndarray, audit: Mapping[str, Any],
            airborne: Sequence[Span], resolution: float) -> dict[str, Any]:
    """A series over time, its extremes kept; ``range`` spans what is clean (and, given ``airborne``, in the air),
    ``beyond`` what lies outside."""
    rows = extreme_rows(values, BUCKETS)
    good = np.isfinite(values)
    trusted = good & ~mask_of(cut_spans(audit, stream), time_s)
    if airborne and (trusted & mask_of(airborne, time_s)).any():
        trusted &= mask_of(airborne, time_s)
    body: dict[str, Any] = {"name": name, "key": stream, "unit": unit, "t": pack(time_s[rows], 2e-3),
                            "v": pack(values[rows], resolution),
                            "cut": [[round(s.start_s, 3), round(s.end_s, 3)] for s in cut_spans(audit, stream)]}
    if trusted.any():
        low, high = float(values[trusted].min()), float(values[trusted].max())
        body["range"] = [float(f"{low:.6g}"), float(f"{high:.6g}")]
        margin = 0.2 * (high - low) + 1e-9
        extremes = float(values[good].min()), float(values[good].max())
        if extremes[0] < low - margin or extremes[1] > high + margin:
            body["beyond"] = [float(f"{v:.6g}") for v in extremes]
    return body


def over_time(flight: Flight, audit: Mapping[str, Any], wanted: Mapping[str, Mapping[str, str]],
              resolution: float) -> dict[str, Any]:
    """Quantities of streams in SI over time: ``wanted`` is stream -> quantity -> label."""
    series = []
    for stream, quantities in wanted.items():
        for quantity, label in quantities.items():
            if stream in flight and len(flight[stream]) and quantity in flight[stream]:
                source = flight[stream]
                unit = source.unit[source.index(quantity)]
                series.append(_series(label, stream, unit, source.time_s, source[quantity], audit, (), resolution))
    return {"series": series} if series else {"absent": f"No {' or '.join(wanted)} stream in this recording."}


def timeline(flight: Flight, audit: Mapping[str, Any]) -> dict[str, Any]:
    """Rows of bars: airborne, clean, and per stream where it is valid and what is wrong with it."""
    if not audit:
        return {"absent": "This recording was not audited."}
    span = span_of(audit) or flight.span
    rows = [{"name": "airborne", "kind": "airborne", "bars": _bars(audit.get("airborne"))},
            {"name": "clean", "kind": "clean", "bars": _bars(audit.get("clean"))}]
    faults = [f for f in audit.get("faults") or [] if group_of(f["kind"]) != "information"]
    names = list(dict.fromkeys([*flight.streams, *streams_of([audit]), *(f["stream"] for f in faults)]))
    for name in names:
        source = flight.streams.get(name)
        whole = source.span if source is not None and len(source) else span
        there = [] if name and source is None else [[round(whole.start_s, 3), round(whole.end_s, 3)]]
        rows.append({"name": name or "whole file", "kind": "stream", "bars": there if name else []})
    return {"span": [span.start_s, span.end_s], "rows": rows,
            "faults": [{"row": f["stream"] or "whole file", "kind": f["kind"], "group": group_of(f["kind"]),
                        "start": round(f["start_s"], 3), "end": round(f["end_s"], 3), "text": f["evidence"]}
                       for f in faults]}


def _bars(spans: Any) -> list[list[float]]:
    return [[round(a, 3), round(b, 3)] for a, b in spans or []]


def fault_list(audit: Mapping[str, Any]) -> dict[str, Any]:
    """The faults as rows of text, one per event: the first one's evidence stands for all of them."""
    groups: dict[tuple[str, ...], list[Mapping[str, Any]]] = {}
    for fault in audit.get("faults") or []:
        kind = kinds().get(fault["kind"])
        if kind is None or kind.in_overview:
            event = kind.event if kind else ("stream",)
            groups.setdefault((fault["kind"], *(str(fault[name]) for name in event)), []).append(fault)
    order = sorted(groups.items(), key=lambda item: (group_of(item[0][0]) == "information", item[1][0]["start_s"]))
    rows = []
    for (name, *_), faults in order[:LISTED_FAULTS]:
        first = faults[0]
        size = number(first.get("size"))
        start, end = min(f["start_s"] for f in faults), max(f["end_s"] for f in faults)
        rows.append([f"{name} ×{len(faults)}" if len(faults) > 1 else name, first["stream"] or "whole file",
                     f"{start:.2f}–{end:.2f}", DASH if size is None else f"{format_number(size, 2)} {first['unit']}",
                     first["evidence"]])
    return {"rows": rows, "left_out": max(0, len(order) - LISTED_FAULTS)}


def stream_list(flight: Flight, audit: Mapping[str, Any]) -> list[list[str]]:
    """One row per stream: samples, rate, share valid, clock offset with interval, wander; or why there is none."""
    rows = []
    for name in dict.fromkeys([*flight.streams, *streams_of([audit])]):
        rate = (audit.get("rates") or {}).get(name) or {}
        clock = (audit.get("clock") or {}).get(name)
        share = share_valid(audit, name) if audit else None
        rows.append([name, str(rate.get("samples") or DASH), format_number(rate.get("rate_hz"), 1),
                     DASH if share is None else format_number(100 * share, 1), *clock_text(name, clock)])
    return rows


def clock_text(stream: str, clock: Mapping[str, Any] | None) -> tuple[str, str]:
    """Offset with interval and wander in ms, or a dash with the reason."""
    if not clock:
        return f"{DASH} {'reference' if stream == 'mocap' else 'not compared'}", DASH
    offset, wander = number(clock.get("offset_s")), number(clock.get("wander_sd_s"))
    if offset is None or not clock.get("identifiable", True):
        return f"{DASH} not identifiable: {clock.get('reason') or 'no reason given'}", DASH
    text = format_number(1e3 * offset, 1)
    if interval := clock.get("ci95_s"):
        text += f" [{format_number(1e3 * interval[0], 1)}, {format_number(1e3 * interval[1], 1)}]"
    return text, DASH if wander is None else format_number(1e3 * wander, 1)

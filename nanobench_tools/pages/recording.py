"""One recording as the page shows it: its verdict, its path and its signals through one time, what is wrong, streams.

A note under the picture lists the drawn series and the thinning; see ``packed``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .. import so3
from ..auditing.faults.kinds import cutting, group_of
from ..auditing.flight_health import sentence_of
from ..flight import Flight, Span, Stream, mask_of
from ..tables.quantities import DASH, format_number, number
from .audit_entry import clock_points, cut_spans, share_valid, span_of, streams_of, total
from .clock_error import SD_95
from .figure import COLOURS, DASHES, Axis, Colour, Figure, Mark, Panel
from .packed import envelope, on_grid, rounded
from .plotly_json import spec

PATH_RATE_HZ, PATH_POINTS = 8.0, 900
"""A path has so many points a second, and so many at most."""
LONGEST_GAP_S = 0.25
CLOCK_POINTS = 200
BUCKETS = 160
"""A series over time shows the extremes of this many stretches of the recording."""
LISTED_EVENTS, DRAWN_EVENTS = 40, 8
PATHS = (("mocap", "motion capture", ("px", "py", "pz"), Mark("", [], [], colour="mocap", width=3.0)),
         ("estimator", "onboard estimate", ("x", "y", "z"), Mark("", [], [], colour="blue")),
         ("setpoint", "set-point", ("x", "y", "z"), Mark("", [], [], colour="orange", dash="dash")))


def view(flight: Flight, audit: Mapping[str, Any] | None,
         taken_out: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Everything the page shows of ``flight``; ``audit`` is its entry of audit.json, None when it was not audited.
    ``taken_out`` is the clock error in estimate.json that the estimator is judged with."""
    audit = audit or {}
    return {"name": flight.name, "verdict": audit.get("verdict") or "", "severity": audit.get("severity") or "",
            "advice": audit.get("advice") or "", "facts": facts(flight, audit), "events": event_list(audit),
            "streams": stream_list(flight, audit), "figure": spec(figure(flight, audit, taken_out))}


def facts(flight: Flight, audit: Mapping[str, Any]) -> list[list[str]]:
    """Label and value of what is known of the recording as a whole."""
    sheet = flight.metadata
    speed = number(sheet.get("reference_speed_m_s"))
    found = {
        "Trajectory": sheet.get("family"),
        "Speed": ", ".join(str(v) for v in (sheet.get("speed"), f"{speed:g} m/s" if speed else None) if v),
        "Controller": audit.get("controller"),
        "Length": f"{flight.span.duration_s:.1f} s",
        "In the air": _seconds(audit.get("airborne")),
        "Usable": _seconds(audit.get("usable", audit.get("clean"))),
        "Health": sentence_of(audit["health"]) if audit.get("health") else None,
        "File": flight.provenance.path.replace("\\", "/").rsplit("/", 1)[-1],
        "SHA-256": flight.provenance.sha256[:12],
    }
    return [[label, str(value)] for label, value in found.items() if value]


def _seconds(spans: Any) -> str | None:
    seconds = total(spans)
    return None if seconds is None else f"{seconds:.1f} s"


def figure(flight: Flight, audit: Mapping[str, Any], taken_out: Mapping[str, Any] | None) -> Figure:
    """Path from above and from the side, the audit, and the signals over one time."""
    airborne = [Span(*s) for s in audit.get("airborne") or []]
    outside: list[str] = []
    panels = [*paths(flight, audit, airborne), *timeline(audit, flight.span)]
    for found, left in (position_error(flight, audit, airborne), attitude_error(flight, audit, airborne),
                        clock_panel(audit, taken_out), battery(flight, audit, airborne), motors(flight, audit)):
        panels += found
        outside += left
    panels += vibration(audit)
    note = ("Error: onboard estimate against motion capture at equal timestamps, not aligned, so a late clock counts. "
            f"Shaded: cut by the audit. Each of {BUCKETS} stretches keeps its extremes; paths have "
            f"{PATH_RATE_HZ:g} points a second.")
    if outside:
        note += f" Outside the frame: {', '.join(outside)}; a double click shows all."
    return Figure(flight.name, note, panels, cursor=(round(flight.span.start_s, 2), round(flight.span.end_s, 2)))


def paths(flight: Flight, audit: Mapping[str, Any], airborne: Sequence[Span]) -> list[Panel]:
    """Motion capture, onboard estimate and set-point in the world [m]; cut spans are gaps.

    The set-point is drawn while the vehicle is airborne. Before and after, the logged set-points (often zeros) are not
    places to be at.
    """
    count = int(np.clip(flight.span.duration_s * PATH_RATE_HZ, 2, PATH_POINTS))
    grid = np.linspace(flight.span.start_s, flight.span.end_s, count)
    above, aside = [], []
    for stream, label, axes, style in PATHS:
        if stream not in flight or not all(a in flight[stream] for a in axes) or not len(flight[stream]):
            continue
        source = _rising(flight[stream])
        points = on_grid(source.time_s, source[axes], grid, LONGEST_GAP_S)
        points[mask_of(cut_spans(audit, stream), grid)] = np.nan
        if stream == "setpoint" and airborne:
            points[~mask_of(airborne, grid) | (points == 0.0).all(axis=1)] = np.nan
        if not np.isfinite(points).any():
            continue
        x, y, z = (rounded(points[:, i], 2e-3) for i in range(3))
        above.append(replace(style, name=label, x=x, y=y, t=grid))
        aside.append(replace(style, name=label, x=x, y=z, t=grid))
    if not above:
        return []
    return [Panel(Axis("x", "m"), Axis("y", "m"), above, "from above", 400, equal=True),
            Panel(Axis("x", "m"), Axis("z", "m"), aside, "from the side", 400, equal=True)]


def timeline(audit: Mapping[str, Any], whole: Span) -> list[Panel]:
    """Bars over time: in the air, usable, and every event that the audit found."""
    if not audit:
        return []
    span = span_of(audit) or whole
    rows: list[tuple[str, Any, Colour, str]] = [
        ("in the air", audit.get("airborne"), "sky", "in the air"),
        ("usable", audit.get("usable", audit.get("clean")), "green", "usable")]
    for event in (audit.get("events") or [])[:DRAWN_EVENTS]:
        rows.append((event["kind"].replace("_", " "), event["spans"], colour_of(event["kind"]), event["sentence"]))
    least = 0.003 * span.duration_s  # shorter ones would be invisible
    marks = [Mark("", [a for a, _ in spans], [float(i)] * len(spans), "bars", colour, size=0.6,
                  high=[max(b, a + least) for a, b in spans],
                  text=[f"{said}: {a:.2f} to {b:.2f} s" for a, b in spans])
             for i, (_, spans, colour, said) in enumerate(rows) if spans]
    return [Panel(Axis("time", "s", range=(span.start_s, span.end_s)), Axis(rows=[name for name, *_ in rows]), marks,
                  "audit", 60 + 26 * len(rows), wide=True, timed=True)]


def colour_of(kind: str) -> Colour:
    """Red for what is cut, orange for what is wrong otherwise, grey for what is only worth knowing."""
    return "red" if kind in cutting() else "grey" if group_of(kind) == "information" else "orange"


def event_list(audit: Mapping[str, Any]) -> dict[str, Any]:
    """When, what in words, what to do and where, of each event."""
    events = audit.get("events") or []
    rows = []
    for event in events[:LISTED_EVENTS]:
        spans = event["spans"]
        when = f"{spans[0][0]:.2f}\u2013{spans[-1][1]:.2f}" + (f", {len(spans)} times" if len(spans) > 1 else "")
        rows.append([event["sentence"], when, event["advice"], ", ".join(s or "whole file" for s in event["streams"])])
    return {"rows": rows, "left_out": max(0, len(events) - LISTED_EVENTS)}


Series = tuple[list[Panel], list[str]]
"""Panels, and in words what lies outside their frames."""


def position_error(flight: Flight, audit: Mapping[str, Any], airborne: Sequence[Span]) -> Series:
    """Distance [mm] between the onboard estimate and motion capture at the same timestamps, not aligned."""
    if not _has(flight, "mocap", "px") or not _has(flight, "estimator", "x"):
        return [], []
    truth, source = _rising(flight["mocap"]), flight["estimator"]
    away = np.linalg.norm(source["x", "y", "z"] - truth.interpolate(("px", "py", "pz"), source.time_s), axis=1)
    away = np.where(truth.span.mask(source.time_s), 1e3 * away, np.nan)
    return _panel("position error", "mm", {"position error": (source.time_s, away)}, "estimator", flight, audit,
                  airborne, 0.1, True)


def attitude_error(flight: Flight, audit: Mapping[str, Any], airborne: Sequence[Span]) -> Series:
    """Angle [deg] between the onboard attitude and motion capture at the same timestamps."""
    if not _has(flight, "mocap", "qw") or not _has(flight, "attitude_qw", "qw"):
        return [], []
    truth, source = _rising(flight["mocap"]), flight["attitude_qw"]
    angle = np.degrees(so3.geodesic_angle(_unit(source["qx", "qy", "qz", "qw"]), so3.interpolate(
        truth.time_s, _unit(truth["qx", "qy", "qz", "qw"]), source.time_s)))
    angle = np.where(truth.span.mask(source.time_s), angle, np.nan)
    return _panel("attitude error", "deg", {"attitude error": (source.time_s, angle)}, "attitude_qw", flight, audit,
                  airborne, 0.01, True)


def clock_panel(audit: Mapping[str, Any], taken_out: Mapping[str, Any] | None) -> Series:
    """The moving clock error [ms] with its 95 % band, where there is one."""
    points = (taken_out or {}).get("warp") or clock_points(audit)
    if not points:
        return [], []
    t, d, sd = np.array(points, float)[:: -(-len(points) // CLOCK_POINTS)].T
    mark = Mark("clock error", rounded(t, 0.02), rounded(1e3 * d, 0.5), "area", "purple",
                low=rounded(1e3 * (d - SD_95 * sd), 0.5), high=rounded(1e3 * (d + SD_95 * sd), 0.5))
    return [Panel(Axis("time", "s"), Axis("clock error", "ms", zero=True), [mark], "", 170, wide=True, timed=True)], []


def battery(flight: Flight, audit: Mapping[str, Any], airborne: Sequence[Span]) -> Series:
    if not _has(flight, "battery", "vbat"):
        return [], []
    source = flight["battery"]
    return _panel("battery", "V", {"battery": (source.time_s, source["vbat"])}, "battery", flight, audit, airborne,
                  2e-3, False)


def motors(flight: Flight, audit: Mapping[str, Any]) -> Series:
    """Motor commands: share of full duty after the battery compensation."""
    found = {f"motor {i}": (flight["motor"].time_s, flight["motor"][f"m{i}"]) for i in range(1, 9)
             if _has(flight, "motor", f"m{i}")}
    if not found:
        return [], []
    panels, _ = _panel("motor PWM ratio", "", found, "motor", flight, audit, (), 2e-3, False)
    return panels, []


def vibration(audit: Mapping[str, Any]) -> list[Panel]:
    """Amplitude density of gyro and accelerometer over frequency, with the frequencies at which the rotors show."""
    panels = []
    for k, (name, found) in enumerate(((audit.get("health") or {}).get("vibration") or {}).items()):
        frequency, density = (list(axis) for axis in zip(*found["spectrum"], strict=True))
        rules = [("x", line["seen_at_hz"]) for line in found["rotors"]]
        panels.append(Panel(Axis("frequency", "Hz"), Axis(f"{name} vibration", f"{found['unit']}/sqrt(Hz)", log=True),
                            [Mark(name, frequency, density, colour=COLOURS[k])],
                            "vibration, rotors dotted" if rules else "vibration", 220, rules=rules))
    return panels


def _panel(title: str, unit: str, series: Mapping[str, tuple[np.ndarray, np.ndarray]], stream: str, flight: Flight,
           audit: Mapping[str, Any], airborne: Sequence[Span], resolution: float, zero: bool) -> Series:
    """Series of one stream over time. The frame shows rows in the air that are not cut; a note describes the rest."""
    cut = cut_spans(audit, stream)
    marks, ranges, outside = [], [], []
    for i, (name, (time_s, values)) in enumerate(series.items()):
        x, y = envelope(time_s, values, (flight.span.start_s, flight.span.end_s), BUCKETS, resolution)
        marks.append(Mark(name, x, y, colour=COLOURS[i % 4], dash=DASHES[i % 4] if len(series) > 1 else "solid",
                          width=1.4))
        good = np.isfinite(values)
        trusted = good & ~mask_of(cut, time_s)
        if airborne and (trusted & mask_of(airborne, time_s)).any():
            trusted &= mask_of(airborne, time_s)
        if trusted.any():
            low, high = float(values[trusted].min()), float(values[trusted].max())
            ranges.append((low, high))
            ends, margin = (float(values[good].min()), float(values[good].max())), 0.2 * (high - low) + 1e-9
            if ends[0] < low - margin or ends[1] > high + margin:
                outside.append(f"{name} from {ends[0]:.3g} to {ends[1]:.3g} {unit}".strip())
    if not ranges:
        return [], []
    low, high = min(r[0] for r in ranges), max(r[1] for r in ranges)
    room = 0.08 * max(high if zero else high - low, 1e-3)
    frame = (0.0 if zero else low - room, high + room)
    return [Panel(Axis("time", "s"), Axis(title, unit, range=frame), marks, "", 180, wide=True, timed=True,
                  shaded=[(round(s.start_s, 2), round(s.end_s, 2), "red") for s in cut])], outside


def _has(flight: Flight, stream: str, column: str) -> bool:
    return stream in flight and column in flight[stream] and len(flight[stream]) > 1


def _rising(stream: Stream) -> Stream:
    """The rows at strictly rising timestamps, so that they can be interpolated."""
    time_s = stream.time_s
    return stream.rows(np.r_[True, time_s[1:] > np.maximum.accumulate(time_s)[:-1]])


def _unit(quaternion: np.ndarray) -> np.ndarray:
    """(n, 4) made unit; what has no direction becomes the identity."""
    norm = np.linalg.norm(quaternion, axis=1, keepdims=True)
    good = np.isfinite(norm) & (norm > 1e-6)
    return np.where(good, quaternion / np.where(good, norm, 1.0), [0.0, 0.0, 0.0, 1.0])


def stream_list(flight: Flight, audit: Mapping[str, Any]) -> list[list[str]]:
    """One row per stream: samples, rate, share valid, clock offset with interval, wander; or why these are missing."""
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

"""A flight's clock error and the position error that it causes, for one picture.

An estimate with a timestamp late by d shows where the vehicle was d earlier. At speed v it lies v d behind on the
track.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..flight import Flight, Span, mask_of
from ..metrics.timing import MINIMUM_SPEED_M_S
from ..metrics.trajectory import rms
from ..tables.quantities import number
from .audit_entry import cut_spans, total
from .figure import Axis, Figure, Mark, Panel
from .packed import envelope, rounded

BUCKETS = 450
"""Pairs of points per curve: a saw-tooth of a quarter of a second is seen as one."""
SD_95 = 1.96
FRAME_S = 12.0
"""A whole flight is too dense to be read."""


def clock_error(flight: Flight, audit: Mapping[str, Any], taken_out: Mapping[str, Any] | None) -> Figure | None:
    """d(t) [ms] with its 95 % band, and the along-track position error and d(t) times speed [mm].

    taken_out: ``clocks.retimed`` of estimate.json for this flight: a clock that was set without comparing estimated
    positions to motion capture. None without one, or without a stretch where the vehicle moves.
    """
    points = (taken_out or {}).get("warp")
    if not points:
        return None
    t, d, sd = np.array(points, float).T
    track = _along(flight, audit, t, d)
    if track is None:
        return None
    span = (float(t[0]), float(t[-1]))
    middle, half = sum(span) / 2.0, min(FRAME_S, span[1] - span[0]) / 2.0
    time = Axis("time", "s", range=(middle - half, middle + half))
    late = Mark("how late the timestamps are, d(t)", rounded(t, 2e-3), rounded(1e3 * d, 0.05), "area",
                low=rounded(1e3 * (d - SD_95 * sd), 0.05), high=rounded(1e3 * (d + SD_95 * sd), 0.05))
    found, note = track
    behind = [Mark(name, *envelope(time_s, values, span, BUCKETS, 0.1), colour=colour, dash=dash)
              for (name, colour, dash), (time_s, values) in zip(
                  (("estimate behind the vehicle, measured", "mocap", "solid"),
                   ("d(t) and the estimator's own delay, times speed", "orange", "dot")), found, strict=True)]
    return Figure(
        f"One flight's clock error, and the position error it makes: {flight.name}",
        "Above, with its 95 % band: estimated from gyro and accelerometer against motion capture, and from the speed "
        "of the estimated position. That position itself was not compared with motion capture. Below: how far "
        f"it lies behind the vehicle along its track, and d(t) plus one constant, times speed. {note} Frame: the "
        f"middle {2 * half:.0f} s; a double click shows all.",
        [Panel(time, Axis("d(t)", "ms", zero=True), [late], "", 230, wide=True, timed=True),
         Panel(time, Axis("behind", "mm", zero=True), behind, "", 260, wide=True, timed=True)])


Track = tuple[list[tuple[np.ndarray, np.ndarray]], str]


def _along(flight: Flight, audit: Mapping[str, Any], t: np.ndarray, d: np.ndarray) -> Track | None:
    """Measured and explained distance behind along the track [mm] over time, and what each explanation leaves, in
    words. Only moving rows in the air that are not cut."""
    if "mocap" not in flight or "estimator" not in flight:
        return None
    truth, source = flight["mocap"], flight["estimator"]
    if "vx" not in truth or "px" not in truth or "x" not in source or not np.all(np.diff(truth.time_s) > 0.0):
        return None
    time_s = source.time_s
    good = (time_s >= t[0]) & (time_s <= t[-1]) & truth.span.mask(time_s)
    good &= mask_of([Span(*s) for s in audit.get("airborne") or []], time_s)
    good &= ~mask_of([*cut_spans(audit, "estimator"), *cut_spans(audit, "mocap")], time_s)
    velocity = truth.interpolate(("vx", "vy", "vz"), time_s)
    speed = np.linalg.norm(velocity, axis=1)
    error = source["x", "y", "z"] - truth.interpolate(("px", "py", "pz"), time_s)
    good &= (speed > MINIMUM_SPEED_M_S) & np.isfinite(error).all(axis=1)
    if good.sum() < 50:
        return None
    with np.errstate(invalid="ignore", divide="ignore"):
        behind = -np.sum(error * velocity, axis=1) / speed
    lateness = np.interp(time_s, t, d)
    own_s, left = _own_delay(behind[good], lateness[good], speed[good])
    constant_s, before = _own_delay(behind[good], np.zeros(good.sum()), speed[good])
    note = (f"The constant, {1e3 * own_s:.1f} ms, is the estimator's own delay and the one number taken from the "
            f"position. Error along the track, RMS: {1e3 * rms(behind[good]):.1f} mm; less the best constant delay "
            f"({1e3 * constant_s:.1f} ms) {1e3 * before:.1f} mm; less d(t) and its constant {1e3 * left:.1f} mm.")
    return [(time_s, np.where(good, 1e3 * v, np.nan)) for v in (behind, (lateness + own_s) * speed)], note


def _own_delay(behind_m: np.ndarray, lateness_s: np.ndarray, speed_m_s: np.ndarray) -> tuple[float, float]:
    """The one constant [s] that fits best in addition to ``lateness_s``, and the RMS [m] it leaves."""
    constant_s = float(speed_m_s @ (behind_m - lateness_s * speed_m_s) / (speed_m_s @ speed_m_s))
    return constant_s, rms(behind_m - (lateness_s + constant_s) * speed_m_s)


def typical(entries: Mapping[str, Mapping[str, Any]], taken_out: Mapping[str, Any]) -> str | None:
    """The flight to show, or None. Of the flights with a confirmed moving error it takes the longer half in the air,
    and of these the one with the median wander."""
    moving = [name for name, found in taken_out.items() if found and found.get("moving") and found.get("warp")
              and name in entries]
    by_length = sorted(moving, key=lambda name: (-(total(entries[name].get("airborne")) or 0.0), name))
    longer = by_length[: (len(by_length) + 1) // 2]
    by_wander = sorted(longer, key=lambda name: (number(taken_out[name].get("wander_sd_s")) or 0.0, name))
    return by_wander[(len(by_wander) - 1) // 2] if by_wander else None

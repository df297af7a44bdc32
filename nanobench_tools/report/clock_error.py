"""A flight's clock error beside the position error it makes, for one picture.

An estimate whose stamp is late by d holds where the vehicle was d earlier: at speed v it lies v d behind on the track.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..flight import Flight, Span, mask_of
from ..metrics.timing import MINIMUM_SPEED_M_S
from ..metrics.trajectory import rms
from .audit_entry import CLOCK_STREAMS, cut_spans, total
from .decimate import extreme_rows, pack
from .quantities import number

BUCKETS = 450
"""Points per curve: a saw-tooth of a quarter of a second is seen as one."""
SD_95 = 1.96


def clock_error(flight: Flight, audit: Mapping[str, Any], taken_out: Mapping[str, Any] | None) -> dict[str, Any]:
    """d(t) [ms] with its 95 % band, and the along-track position error beside d(t) times speed [mm].

    taken_out: ``clocks.retimed`` of estimate.json for this flight: a clock that was set without comparing estimated
    positions to motion capture. Without it the audit's clock is drawn, which the position helped to set, and no error
    beside it: that would agree by construction.
    """
    apart = bool(taken_out and taken_out.get("warp"))
    points = (taken_out or {}).get("warp") if apart else _audit_time_offset(audit)
    if not points:
        why = (taken_out or {}).get("reason")
        return {"absent": f"No moving clock error to draw{f': {why}' if why else ' in this recording'}."}
    t, d, sd = np.array(points, float).T
    body: dict[str, Any] = {"apart": apart, "t": pack(t, 2e-3), "d": pack(1e3 * d, 0.05),
                            "low": pack(1e3 * (d - SD_95 * sd), 0.05), "high": pack(1e3 * (d + SD_95 * sd), 0.05),
                            "wander_ms": 1e3 * (number((taken_out or {}).get("wander_sd_s")) or float(np.std(d)))}
    track = _along(flight, audit, t, d) if apart else None
    return body if track is None else {**body, **track}


def _audit_time_offset(audit: Mapping[str, Any]) -> Sequence[Sequence[float]]:
    clocks = audit.get("clock") or {}
    return next((clocks[s]["warp"] for s in CLOCK_STREAMS if (clocks.get(s) or {}).get("warp")), ())


def _along(flight: Flight, audit: Mapping[str, Any], t: np.ndarray, d: np.ndarray) -> dict[str, Any] | None:
    """Measured and explained distance behind along the track [mm], in the air, where nothing is cut and it moves."""
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
    measured, predicted = (np.where(good, 1e3 * v, np.nan) for v in (behind, (lateness + own_s) * speed))
    rows = np.union1d(extreme_rows(measured, BUCKETS), extreme_rows(predicted, BUCKETS))
    return {"te": pack(time_s[rows], 2e-3), "measured": pack(measured[rows], 0.1), "told": pack(predicted[rows], 0.1),
            "own_ms": 1e3 * own_s, "constant_ms": 1e3 * constant_s, "rms_mm": 1e3 * rms(behind[good]),
            "rms_constant_mm": 1e3 * before, "rms_left_mm": 1e3 * left}


def _own_delay(behind_m: np.ndarray, lateness_s: np.ndarray, speed_m_s: np.ndarray) -> tuple[float, float]:
    """The one constant [s] beside ``lateness_s`` that fits best, and the RMS [m] it leaves."""
    constant_s = float(speed_m_s @ (behind_m - lateness_s * speed_m_s) / (speed_m_s @ speed_m_s))
    return constant_s, rms(behind_m - (lateness_s + constant_s) * speed_m_s)


def typical(entries: Mapping[str, Mapping[str, Any]], taken_out: Mapping[str, Any]) -> str | None:
    """The flight to show: of those whose moving error was confirmed the longer half in the air, and of these the one
    with the median wander; None when there is none."""
    moving = [name for name, found in taken_out.items() if found and found.get("moving") and found.get("warp")
              and name in entries]
    by_length = sorted(moving, key=lambda name: (-(total(entries[name].get("airborne")) or 0.0), name))
    longer = by_length[: (len(by_length) + 1) // 2]
    by_wander = sorted(longer, key=lambda name: (number(taken_out[name].get("wander_sd_s")) or 0.0, name))
    return by_wander[(len(by_wander) - 1) // 2] if by_wander else None

"""When a vehicle was lost: tumbled, lay on its side, or fell out of the air."""

from dataclasses import dataclass

import numpy as np

from ..settings import number
from .airborne import airborne_spans, height_of
from .context import Context
from .pose_frame import orientation_of, pose_frame
from .usable_rows import runs, usable_streams

TILT_RAD = number("audit.crashes.tilt_rad")
LASTS_S = number("audit.crashes.lasts_s")
FALL_M_S = number("audit.crashes.fall_m_s")
FALL_OVER_S = number("audit.crashes.fall_over_s")
LOOK_BACK_S = number("audit.crashes.look_back_s")
FALL_M = number("audit.crashes.fall_m")
AFTER_S = number("audit.crashes.after_s")


@dataclass(frozen=True)
class Crash:
    """start_s: when it began; size: largest tilt, rad; evidence in words."""

    start_s: float
    size: float
    evidence: str


def crash_of(context: Context) -> Crash | None:
    """The first one; None if it flew and landed, or if the attitude is of another body than the vehicle."""
    air, oriented = context.once(airborne_spans), context.once(orientation_of)
    if not air or oriented is None or context.once(pose_frame).foreign_rad:
        return None
    time_s, quaternion = oriented
    tilt = np.arccos(np.clip(1.0 - 2.0 * (quaternion[:, 0] ** 2 + quaternion[:, 1] ** 2), -1.0, 1.0))
    began = [(float(time_s[a]), f"tilted by up to {np.degrees(tilt[a:b].max()):.0f} deg from {time_s[a]:.2f} s on")
             for a, b in runs(tilt > TILT_RAD)
             if time_s[b - 1] - time_s[a] >= LASTS_S and time_s[a] >= air[0].start_s]
    began += [fall for fall in [_fall(context)] if fall]
    if not began:
        return None
    first, evidence = min(began)
    after = tilt[time_s >= first]
    return Crash(_motors_off(context, first), float(after.max()) if len(after) else float("nan"), evidence)


def _fall(context: Context) -> tuple[float, str] | None:
    """Time and words of the first steady descent faster than FALL_M_S over FALL_OVER_S, by the slope of the height.
    Jumps of a tracker last one frame and are not steady."""
    height = context.once(height_of)
    if height is None:
        return None
    time_s, z = height
    rows = max(round(FALL_OVER_S / max(float(np.median(np.diff(time_s))), 1e-4)), 2)
    if len(z) < 4 * rows:
        return None
    step = np.diff(z) / np.maximum(np.diff(time_s), 1e-6)
    falling = runs(step < -FALL_M_S)
    for a, b in falling:
        if b - a >= rows and z[a] - z[b] > FALL_M:
            return float(time_s[a]), f"falls at {-step[a:b].min():.1f} m/s"
    return None


def _motors_off(context: Context, first_s: float) -> float:
    """When the motors stopped, if within LOOK_BACK_S before ``first_s``; else a little before it."""
    motor = context.once(usable_streams).get("motor")
    if motor is not None:
        off = runs(~(np.nan_to_num(motor.values) > 0.0).any(axis=1))
        starts = [float(motor.time_s[a]) for a, _ in off
                  if first_s - LOOK_BACK_S <= motor.time_s[a] <= first_s + AFTER_S]
        if starts:
            return starts[0]
    return first_s - LASTS_S

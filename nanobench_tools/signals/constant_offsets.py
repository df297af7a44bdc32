"""Constant offsets of velocity, tilt and accelerometer, by laws that hold on the mean of a flight.

The mean of a velocity is the way over the time. The mean specific force of a flight points along the thrust, and at
rest it is gravity. A mean tilt that neither the path nor the accelerometer explains is an offset of the attitude. A
vehicle that leans into a wind feels its tilt. Any other mean of the accelerometer is an offset of the sensor. An offset
of a position is its origin, and that of a yaw is a heading.
"""

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..frames import gravity_up
from ..settings import number
from ..units import GRAVITY_M_S2
from .airborne import airborne_spans
from .context import Context
from .estimated_turning import known_estimate
from .gyro_offset import BLOCK_S, resting_blocks
from .held_poses import ROTATION
from .mocap_derivatives import derivatives_of
from .own_reference import own_reference
from .paired_signals import FEWEST_ROWS, flying_rows, on_grid
from .stream_frames import IMU

VELOCITY_M_S = number("audit.constant_offsets.velocity_m_s")
TILT_RAD = number("audit.constant_offsets.tilt_rad")
FLOWN_M_S2 = number("audit.constant_offsets.flown_m_s2")
RESTING_M_S2 = number("audit.constant_offsets.resting_m_s2")
VELOCITIES = {"estimator": ("vx", "vy", "vz"), "mocap": ("vx", "vy", "vz")}


@dataclass(frozen=True)
class ConstantOffset:
    """Constant offsets of a stream, one per quantity, in ``unit``. An offset beyond ``limit`` is ``wrong``."""

    stream: str
    quantities: tuple[str, ...]
    offset: np.ndarray
    limit: float
    unit: str
    by: str

    @property
    def wrong(self) -> list[int]:
        return [i for i, size in enumerate(self.offset) if abs(size) > self.limit]


def constant_offsets(context: Context) -> list[ConstantOffset]:
    """Every offset that can be read from this recording, large or not."""
    flown = _flown(context)
    if any(o.wrong for o in flown if o.unit == "rad"):
        return flown  # the accelerometer is judged by this tilt
    return flown + [o for o in [_resting(context)] if o is not None]


def _flown(context: Context) -> list[ConstantOffset]:
    """By the path: that of the motion capture, else that of the estimate."""
    reference = context if "mocap" in context.flight else context.once(own_reference)
    truth, use = (None, None) if reference is None else (reference.once(derivatives_of), reference.once(flying_rows))
    if reference is None or truth is None or use is None:
        return []
    use = use & truth.good
    found = []
    for name, names in VELOCITIES.items():
        placed = on_grid(reference, name, names) if name in context.flight else None
        if placed is not None and (rows := use & placed[1]).sum() >= FEWEST_ROWS:
            found.append(ConstantOffset(name, names, (placed[0] - truth.velocity_m_s)[rows].mean(axis=0), VELOCITY_M_S,
                                        "m/s", "the way over the time"))
    estimate = known_estimate(context)
    if estimate is None:
        return found
    placed = on_grid(reference, "imu", IMU[1])
    use &= (truth.time_s >= estimate.time_s[0]) & (truth.time_s <= estimate.time_s[-1])
    if placed is None or (rows := use & placed[1]).sum() < FEWEST_ROWS:
        return found
    turn = so3.interpolate(estimate.time_s, estimate[ROTATION], truth.time_s)
    force = so3.rotate_inverse(turn, truth.acceleration_m_s2 + gravity_up())
    mean, felt = force[rows].mean(axis=0), placed[0][rows].mean(axis=0)
    leans, beyond = (np.array([v[1], -v[0]]) / mean[2] for v in (mean, mean - felt))
    offset = np.where(leans * beyond > 0.0, np.sign(leans) * np.minimum(np.abs(leans), np.abs(beyond)), 0.0)
    stream = "attitude" if "attitude" in context.flight else "attitude_qw"
    tilt = ConstantOffset(stream, ("roll", "pitch") if stream == "attitude" else ("qx", "qy"), offset, TILT_RAD, "rad",
                          "the accelerations of the path and the accelerometer")
    if tilt.wrong:
        return [*found, tilt]
    return [*found, tilt, ConstantOffset("imu", IMU[1], felt - mean, FLOWN_M_S2, "m/s^2",
                                         "the accelerations of the path in the estimated attitude")]


def _resting(context: Context) -> ConstantOffset | None:
    """By gravity before the flight, in the estimated attitude; without one, by its size along z."""
    if not context.once(airborne_spans):
        return None
    start_s = context.once(airborne_spans)[0].start_s
    blocks = [(at, acc) for at, _, acc in resting_blocks(context) if at < start_s - BLOCK_S]
    if not blocks:
        return None
    at, acc = np.array([t for t, _ in blocks]), np.array([a for _, a in blocks])
    estimate = known_estimate(context)
    if estimate is None:
        return ConstantOffset("imu", IMU[1][2:], np.array([np.median(np.linalg.norm(acc, axis=1)) - GRAVITY_M_S2]),
                              RESTING_M_S2, "m/s^2", "gravity at rest")
    turn = so3.interpolate(estimate.time_s, estimate[ROTATION], np.clip(at, estimate.time_s[0], estimate.time_s[-1]))
    return ConstantOffset("imu", IMU[1], np.median(acc - so3.rotate_inverse(turn, gravity_up()), axis=0), RESTING_M_S2,
                          "m/s^2", "gravity at rest in the estimated attitude")

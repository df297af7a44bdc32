"""Which signs, axes and offsets no other column of a recording shows: what an audit without a finding leaves open."""

from __future__ import annotations

import numpy as np

from .attitude_signs import angle_matches
from .axis_unit_matching import axis_unit_matches
from .constant_offsets import RESTING_M_S2, constant_offsets
from .context import Context
from .estimated_turning import EULER, GYRO
from .flown_axes import UP, ground_axes
from .gravity import ACC, gravity_axis
from .held_poses import POSITION, ROTATION
from .motor_turning import MOTORS, motor_turning
from .own_reference import matches_by_estimate, own_reference
from .own_turning import FOLLOWS, own_turning
from .shared_frame import PLACE
from .tilt_heading import FOLLOWS as TILT_FOLLOWS
from .tilt_heading import straight

SIGNED = {"mocap": (*POSITION, *ROTATION), "estimator": (*PLACE, "vx", "vy", "vz"), "attitude": EULER,
          "imu": (*GYRO, *ACC), "estimator_acc": ("ax", "ay", "az")}
OFFSETS = {"estimator": ("vx", "vy", "vz"), "attitude": EULER, "imu": ACC}


def unchecked(context: Context) -> tuple[str, ...]:
    """``sign of acc_x, acc_y (imu)`` and the like, one entry for each vector; empty where everything is checked."""
    shown, streams = _shown(context), context.flight.streams
    found = []
    for name, names in SIGNED.items():
        left = [q for q in names if name in streams and q in streams[name] and (name, q) not in shown]
        found += [f"sign and axis of {', '.join(left)} ({name})"] if left else []
    if "motor" in streams and all(q in streams["motor"] for q in MOTORS) and motor_turning(context) is None:
        found.append("order of the motors")
    known = {(o.stream, q) for o in context.once(constant_offsets) for q in o.quantities
             if o.unit != "m/s^2" or o.limit <= RESTING_M_S2}
    for name, names in OFFSETS.items():
        left = [q for q in names if name in streams and q in streams[name] and (name, q) not in known]
        found += [f"constant offset of {', '.join(left)} ({name})"] if left else []
    return tuple(found)


def _shown(context: Context) -> set[tuple[str, str]]:
    """(stream, quantity) of every column that another one confirms or contradicts."""
    reference = context if "mocap" in context.flight else context.once(own_reference)
    gravity, turning, pushed = context.once(gravity_axis), context.once(own_turning), context.once(motor_turning)
    shown = {("imu", ACC[gravity.axis])} if gravity is not None else set()
    shown |= {("imu", q) for q in GYRO[:2] if pushed is not None}
    follows = np.zeros(3) if turning is None else np.abs(np.diag(turning.follows))
    for i, gyro in enumerate(GYRO):
        shown |= {("imu", gyro), ("attitude", EULER[i])} if follows[i] > FOLLOWS else set()
    shown |= {(stream, q) for match in context.once(angle_matches) if np.abs(match.follows).max() > FOLLOWS
              for stream, q in (("imu", match.gyro), ("attitude", match.angle))}
    if reference is None:
        return shown
    shown |= {("mocap", "pz"), ("estimator", "z")} if UP in reference.once(ground_axes) else set()
    if straight(reference) > TILT_FOLLOWS:
        shown |= {(name, q) for name in ("mocap", "estimator") for q in ("px", "py", "qx", "qy", "qw", "x", "y")}
        shown |= {("attitude", "roll"), ("attitude", "pitch")}
    own = [] if reference is context else matches_by_estimate(reference)
    for match in own or context.once(axis_unit_matches).values():
        clear = [i for i in range(3) if match.sign[i]]
        shown |= {(match.stream, match.quantities[i]) for i in clear}
        place = match.stream in ("estimator", "setpoint")
        if match.quantities[0] in ("gyro_x", "roll", "qx"):
            shown |= {("mocap", q) for i in clear for q in (ROTATION[i], "qw")}
        shown |= {("estimator", PLACE[i]) if own else ("mocap", POSITION[i]) for i in clear if own or place}
    return shown

"""Which signs, axes, scales and offsets no other column of a recording shows: what an audit without a finding leaves
open."""

import numpy as np

from ..flight import motors_of
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
from .pairs import force_pair
from .shared_frame import PLACE
from .tilt_heading import followed_axes

VELOCITY = ("vx", "vy", "vz")
AXES, SIZES = "sign and axis", "sign, axis and scale"
SIGNED = (("mocap", (*POSITION, *ROTATION), AXES), ("mocap", VELOCITY, SIZES), ("estimator", PLACE, AXES),
          ("estimator", VELOCITY, SIZES), ("attitude", EULER, SIZES), ("imu", (*GYRO, *ACC), SIZES),
          ("estimator_acc", ("ax", "ay", "az"), SIZES))
"""Stream, quantities, and what is open where no other column shows them. A path is judged by ``_scales``."""
SCALED = ("motor", "motor_request", "rpm", "command", "battery", "stand")
"""Streams with sizes that depend on the vehicle, so that only a factor beyond any vehicle shows."""
OFFSETS = {"estimator": VELOCITY, "attitude": EULER, "imu": ACC}


def unchecked(context: Context) -> tuple[str, ...]:
    """``sign of acc_x, acc_y (imu)`` and the like, one entry for each vector; empty where everything is checked."""
    shown, streams = _shown(context), context.flight.streams
    found = []
    for name, names, what in SIGNED:
        left = [q for q in names if name in streams and q in streams[name] and (name, q) not in shown]
        found += [f"{what} of {', '.join(left)} ({name})"] if left else []
    if "motor" in streams and "stand" not in streams and all(q in streams["motor"] for q in MOTORS) \
            and motor_turning(context) is None:
        found.append("order of the motors")
    if "rpm" in streams and "stand" not in streams and len(motors_of(streams["rpm"])) > 1:
        found.append("order of the rotors (rpm)")
    found += _scales(context)
    known = {(o.stream, q) for o in context.once(constant_offsets) for q in o.quantities
             if o.unit != "m/s^2" or o.limit <= RESTING_M_S2}
    for name, names in OFFSETS.items():
        left = [q for q in names if name in streams and q in streams[name] and (name, q) not in known]
        found += [f"constant offset of {', '.join(left)} ({name})"] if left else []
    return tuple(found)


def _scales(context: Context) -> list[str]:
    """``scale of m1, m2 (motor)`` and the like; of a path with its time, where no tilt and no force shows it. An
    inertial sensor alone leaves its time open."""
    streams = context.flight.streams
    found = {name: [q for q in streams[name].quantities if q != "tick"] for name in SCALED if name in streams}
    name, place = ("mocap", POSITION) if "mocap" in streams else ("estimator", PLACE)
    reference = context if name == "mocap" else context.once(own_reference)
    force = context.once(axis_unit_matches).get(force_pair)
    shown = (reference is not None and any(followed_axes(reference))) or (
        force is not None and bool(np.isfinite(force.ratio[:2]).any()))
    if name in streams and not shown:
        found[name] = [*(q for q in place if q in streams[name]), "t"]
    elif name in streams and (force is None or not np.isfinite(force.ratio[2])):
        found[name] = [q for q in place[2:] if q in streams[name]]  # a tilt shows the horizontal alone
    elif name not in streams and "imu" in streams and not {("imu", q) for q in GYRO} & _shown(context):
        found["imu"] = ["t"]
    return [f"scale of {', '.join(quantities)} ({name})" for name, quantities in found.items() if quantities]


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
    followed = followed_axes(reference)
    shown |= {place for place, yes in zip((("mocap", "px"), ("mocap", "py")), followed, strict=True) if yes}
    shown |= {place for place, yes in zip((("estimator", "x"), ("estimator", "y")), followed, strict=True) if yes}
    if all(followed):
        shown |= {("mocap", q) for q in ("qx", "qy", "qw")} | {("attitude", "roll"), ("attitude", "pitch")}
    own = [] if reference is context else matches_by_estimate(reference)
    for match in own or context.once(axis_unit_matches).values():
        clear = [i for i in range(3) if match.sign[i]]
        shown |= {(match.stream, match.quantities[i]) for i in clear}
        place = match.stream in ("estimator", "setpoint")
        if match.quantities[0] in ("gyro_x", "roll", "qx"):
            shown |= {("mocap", q) for i in clear for q in (ROTATION[i], "qw")}
        shown |= {("estimator", PLACE[i]) if own else ("mocap", POSITION[i]) for i in clear if own or place}
    return shown

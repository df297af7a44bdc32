"""frame: a stream is in other axes than it should be, turned as a whole (FRD for FLU, NED for z up, y up).

Found by what the vehicle does. For the tracked poses (``signals.flown_axes``), a multirotor accelerates towards the
side to which it tilts. It flies above the ground on which it rested. Inverted quaternions and an attitude in a world of
another heading tilt to another side (``signals.tilt_heading``). The other streams: their correlation with the motion
capture's prediction, and gravity. Both are evaluated for each of the 24 rotations by quarter and half turns
(``signals.stream_frames``). Gyro and accelerometer turn together, poses and attitude together, and an axis that does
not move turns with the others. One negated column is ``sign``, two that changed places ``axis_swap``.

Of an IMU without a stream to compare it with, gravity shows where z points. The axes are then a question: FRD first
where z points down, else the four frames that have this axis up.

Axes are named by where they point (``axes``): FRD is forward, right, down; a world ENU is one with z up.

A velocity in the axes of the body follows the path once it is turned by the attitude (``signals.body_velocity``).

Size: angle of the turn, rad. Smallest found: a quarter turn.
"""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from ...flight import Fault, Flight, poses_alone
from ...signals.body_velocity import VELOCITY, body_velocities
from ...signals.context import Context
from ...signals.held_poses import POSITION, ROTATION
from ...signals.pose_frame import pose_frame
from ...signals.shared_frame import shared_frame
from ...signals.stream_frames import (
    IMU,
    StreamTurn,
    assignments,
    how,
    in_words,
    lone_imu,
    pose_turn,
    stream_turns,
)
from ...signals.tilt_heading import wrong_heading
from ...sources.axes import BODY_VECTORS, EULER, QUATERNION, WORLD_VECTORS, name_of
from .kind import FaultKind
from .making import SINCE, over_stream

KIND = "frame"
FRAMED = tuple(dict.fromkeys(q for v in (*WORLD_VECTORS, *BODY_VECTORS, QUATERNION, EULER) for q in v))
FORWARD_RIGHT_DOWN = np.diag([1.0, -1.0, -1.0])
LETTERS = {"N": "north", "S": "south", "E": "east", "W": "west", "U": "up", "D": "down", "F": "forward", "B": "back",
           "L": "left", "R": "right"}


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per stream."""
    turns = [turn for turn in context.once(stream_turns)
             if turn.stream != "mocap" or turn.vectors == (VELOCITY,)]
    shared = context.once(shared_frame)
    poses = _poses(context) if shared is None or "mocap" not in shared.streams else []
    found = [*_shared(context), *poses, *(_stream(context, turn) for turn in turns), *_lone(context)]
    return found or [over_stream(KIND, flight, name, VELOCITY, math.nan, "rad",
                                 f"vx, vy, vz of {name} are in the axes of the body (median error {written:.2g} m/s, "
                                 f"turned by the attitude {turned:.2g})", math.pi / 2)
                     for name, written, turned in context.once(body_velocities)]


def _shared(context: Context) -> list[Fault]:
    """One fault per stream of axes that all of them share; their sentence is one."""
    shared = context.once(shared_frame)
    if shared is None:
        return []
    axes, angle = shared.axes, max(_angle(shared.axes.world), _angle(shared.axes.body))
    text = (f"{', '.join(shared.streams)} are in {_meaning(axes.name)}: write frame = \"{axes.name}\" into each of "
            f"these streams{SINCE}{shared.why}")
    return [over_stream(KIND, context.flight, name, [q for q in FRAMED if q in context.flight[name]], angle, "rad",
                        text, math.pi / 2) for name in shared.streams]


def _stream(context: Context, found: StreamTurn) -> Fault:
    """Of a stream other than the motion capture."""
    flight, turn = context.flight, found.turn
    world = flight[found.stream].frame == "world" and found.stream not in ("attitude", "attitude_qw")
    moved = [new for names in found.vectors for new, *_ in assignments(turn, names) if new in flight[found.stream]]
    axes = f"{name_of(turn, True)}/{name_of(turn, False)}" if found.stream in ("attitude", "attitude_qw") else (
        name_of(turn, world))
    what = f"velocity of {found.stream}" if found.vectors[0] == VELOCITY else found.stream
    return over_stream(KIND, flight, found.stream, moved, _angle(turn), "rad",
                       f"the {what} is in {_meaning(axes)}, turned by {in_words(turn)}: "
                       f"{how(turn, found.vectors)}{SINCE}{found.why}", math.pi / 2)


def _lone(context: Context) -> list[Fault]:
    """At most one fault: of an IMU alone, by gravity. A z that points down is FRD by custom; the other readings are
    named, because gravity does not exclude them."""
    found = context.once(lone_imu)
    if found is None:
        return []
    stream = context.flight["imu"]
    vectors = tuple(v for v in IMU if all(q in stream for q in v))
    down = found.axis == 2
    turn = FORWARD_RIGHT_DOWN if down else found.turns[0]
    seen = f"gravity lies along {'-' * bool(found.sign < 0)}{IMU[1][found.axis]}"
    names = [name_of(t, False) for t in found.turns if not (down and np.array_equal(t, turn))]
    if down:
        text = (f"z of the imu points down, most likely in {_meaning('FRD')}: {how(turn, vectors)}{SINCE}{seen}. Is x "
                f"back or to the side ({', '.join(names)}), or acc_z alone negated? No other stream shows it")
    else:
        text = (f"{'xyz'[found.axis]} of the imu points {'up' if found.sign > 0 else 'down'}: is it in "
                f"{', '.join(names[:-1])} or {names[-1]} axes? {seen}, and no other stream shows which axis is forward")
    moved = [new for names_ in vectors for new, *_ in assignments(turn, names_)] if down else [
        q for names_ in vectors for q in names_]
    return [over_stream(KIND, context.flight, "imu", moved, _angle(turn) if down else math.pi / 2, "rad", text,
                        math.pi / 2)]


def _poses(context: Context) -> list[Fault]:
    """At most one fault: of the motion capture."""
    frame = context.once(pose_frame)
    world, body, why = context.once(pose_turn)
    alone = poses_alone(context.flight)
    if not why and (heading := context.once(wrong_heading)) is not None:
        return [over_stream(KIND, context.flight, "mocap", ROTATION, heading[0], "rad",
                            f"the vehicle does not speed up towards the side to which it tilts: {heading[1]}",
                            math.pi / 2)]
    if not why or frame.foreign_rad or (alone and np.array_equal(world, np.eye(3))):
        return []
    stream = context.flight["mocap"]
    if frame.world is None:
        return [over_stream(KIND, context.flight, "mocap", POSITION, math.nan, "rad",
                            f"z is not up in the motion capture, and the poses do not show which axis is{SINCE}{why}",
                            math.pi / 2)]
    turned = all(q in stream for q in ROTATION)
    told = [how(world, (POSITION,))] if not np.array_equal(world, np.eye(3)) else []
    told += [_quaternion(world, body)] if turned else []
    moved = [q for names, turn in ((POSITION, world), (("vx", "vy", "vz"), world), (("wx", "wy", "wz"), body))
             if all(n in stream for n in names) for q, *_ in assignments(turn, names)]
    axes = name_of(world, True) + (f"/{name_of(body, False)}" if turned else "")
    return [over_stream(KIND, context.flight, "mocap", [*moved, *(q for q in ROTATION if turned)],
                        max(_angle(world), _angle(body)), "rad",
                        f"the motion capture is in {_meaning(axes)}: {'; '.join(told)}{SINCE}{why}", math.pi / 2)]


def _meaning(axes: str) -> str:
    """``FRD axes (body: forward, right, down)``, as ``frame`` of a column map takes them."""
    parts = [", ".join(LETTERS[letter] for letter in part) for part in axes.split("/")]
    return f"{axes} axes ({'; '.join(parts)})"


def _quaternion(world: np.ndarray, body: np.ndarray) -> str:
    if np.array_equal(world, body):
        return how(world, (ROTATION[:3],))
    turn = [f"by {in_words(t)} on the {side}" for t, side in ((world, "left"), (body.T, "right"))
            if not np.array_equal(t, np.eye(3))]
    return f"turn the quaternions {' and '.join(turn)}"


def _angle(turn: np.ndarray) -> float:
    return float(Rotation.from_matrix(turn).magnitude())


FAULT = FaultKind(KIND, find, __doc__,
                  told="{evidence}",
                  advice="write these axes into the column map, as frame = \"AXES\" of the stream",
                  cuts=True, cuts_trim=False, whole=True, across=True)

"""Streams whose axes are those of the convention turned as a whole: FRD for FLU, NED for ENU, quarter and half turns.

A turn is a proper rotation that all vectors of a frame share. It is accepted where it explains the stream clearly
better than its axes as stored, and where all clear evidence agrees with it. Such evidence is two axes that are clearly
wrong, or one that clearly is another. It then also decides the sign of an axis that does not move, which the data of
that axis cannot show. Errors that no rotation explains (one negated column, two that changed places) are left to
``sign`` and ``axis_swap``.
"""

from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np
from scipy.spatial.transform import Rotation

from ..settings import number
from .axis_unit_matching import CLEAR, CLEARLY, AxisUnitMatch, certain, correlations
from .context import Context
from .estimated_turning import estimated_attitude, follows_estimate
from .gravity import GRAVITY_SHARE, Gravity, gravity_axis
from .held_poses import POSITION, ROTATION
from .pairs import force_pair, gyro_pair, sums_of
from .pose_frame import pose_frame
from .shared_frame import shared_frame
from .wrong_matches import wrong_matches

EULER = ("roll", "pitch", "yaw")
IMU = (("gyro_x", "gyro_y", "gyro_z"), ("acc_x", "acc_y", "acc_z"))
ROTATIONS = tuple(turn for order in permutations(range(3)) for signs in product((1.0, -1.0), repeat=3)
                  for turn in [np.eye(3)[list(order)] * np.array(signs)[:, None]] if np.linalg.det(turn) > 0.0)
"""The 24 rotations (3, 3) of quarter and half turns, the identity first."""
GRAVITY_WEIGHT = number("audit.stream_frames.gravity_weight")
ALONE = number("audit.stream_frames.alone")


@dataclass(frozen=True)
class StreamTurn:
    """``turn`` (3, 3) takes each of ``vectors`` of a stream, as stored, to the axes of the convention. ``why`` gives
    the evidence in words."""

    stream: str
    vectors: tuple[tuple[str, ...], ...]
    turn: np.ndarray
    why: str


def stream_turns(context: Context) -> list[StreamTurn]:
    """Every stream in turned axes, once; without those of ``shared_frame``."""
    shared = context.once(shared_frame)
    found = [turn for turn in [_imu(context)] if turn is not None
             and (shared is None or "imu" not in shared.streams)]
    streams: dict[str, list[AxisUnitMatch]] = {}
    for match in wrong_matches(context):
        if match.stream != "imu":
            streams.setdefault(match.stream, []).append(match)
    for stream, matches in streams.items():
        if (turn := _shared(matches)) is not None:
            why = ", ".join(f"{m.quantities[i]} follows {'-' * bool(m.sign[i] < 0)}{'xyz'[m.order[i]]} "
                            f"({m.correlation[i]:+.2f})" for m in matches for i in range(3) if m.sign[i])
            found.append(StreamTurn(stream, tuple(m.quantities for m in matches), turn, why))
    return found


def pose_turn(context: Context) -> tuple[np.ndarray, np.ndarray, str]:
    """(world, body, why): the rotations (3, 3) that take the tracked poses to the convention. That has z up, and
    headings as in the vehicle's own streams where these agree with each other. ``why`` is empty where nothing is
    turned."""
    frame = context.once(pose_frame)
    turns = {turn.vectors[0]: turn for turn in context.once(stream_turns) if turn.stream == "mocap"}
    world, body = frame.axes.world, frame.axes.body
    heading, mark = turns.get(POSITION), turns.get(ROTATION[:3])
    if heading is not None:
        world = heading.turn @ world
    if mark is not None:
        body = mark.turn @ body
    whys = (frame.evidence, heading and f"for the estimate and the set-point {heading.why}",
            mark and f"for gyro and attitude {mark.why}")
    return world, body, "; ".join(why for why in whys if why)


def unexplained(context: Context) -> list[AxisUnitMatch]:
    """``wrong_matches`` without what ``stream_turns`` explain; units stay."""
    turned = {turn.stream for turn in context.once(stream_turns)}
    return [replace(match, order=(0, 1, 2), sign=(0, 0, 0), swapped=False) if match.stream in turned else match
            for match in context.once(wrong_matches)]


def unexplained_gravity(context: Context) -> Gravity | None:
    """``gravity_axis`` of an accelerometer whose frame is not turned as a whole, where another stream shows that."""
    shared = context.once(shared_frame)
    turned = any(turn.stream == "imu" for turn in context.once(stream_turns)) or (
        shared is not None and "imu" in shared.streams)
    return None if turned or context.once(lone_imu) is not None else context.once(gravity_axis)


@dataclass(frozen=True)
class LoneImu:
    """Gravity ``axis`` and ``sign`` of an IMU that no other stream judges; ``turns`` (3, 3): those of ``ROTATIONS``
    after which z is up, the identity never among them."""

    axis: int
    sign: int
    turns: tuple[np.ndarray, ...]


def lone_imu(context: Context) -> LoneImu | None:
    """An IMU whose z is not up, in a recording without an attitude or motion capture to compare it with."""
    gravity = context.once(gravity_axis)
    if gravity is None or (gravity.axis, gravity.sign) == (2, 1) or estimated_attitude(context) is not None:
        return None
    if any(sums_of(context, make) is not None for make in (gyro_pair, force_pair)):
        return None
    up = np.zeros(3)
    up[gravity.axis] = gravity.sign
    return LoneImu(gravity.axis, gravity.sign, tuple(turn.T for turn in ROTATIONS if turn[:, 2] @ up > 0.5))


def _shared(matches: list[AxisUnitMatch]) -> np.ndarray | None:
    """The one rotation that all signs of the matches of a stream agree with; or None, or several."""
    orders = {match.order for match in matches if match.swapped}
    if len(orders) > 1:
        return None
    order = orders.pop() if orders else (0, 1, 2)
    fitting = [turn for turn in ROTATIONS if all(
        turn[i, order[i]] != 0.0 and match.sign[i] in (0, turn[i, order[i]]) for match in matches for i in range(3))]
    wrong = {(i, order[i]) for match in matches for i in range(3) if match.sign[i] < 0 or order[i] != i}
    return fitting[0].T if len(fitting) == 1 and len(wrong) > 1 else None


def _imu(context: Context) -> StreamTurn | None:
    """The turn of gyro and accelerometer together."""
    gravity = context.once(gravity_axis)
    mean = None if gravity is None else np.array(gravity.mean) / np.linalg.norm(gravity.mean)
    made = {make: (sums, correlations(sums)) for make in (gyro_pair, force_pair)
            if (sums := sums_of(context, make)) is not None}
    if gyro_pair not in made:
        return _imu_by_estimate(context, mean)

    def follows(turn: np.ndarray, k: np.ndarray) -> float:
        return float((turn * k).sum(axis=(1, 2)).max())

    def score(turn: np.ndarray) -> float:
        told = sum(follows(turn, k) * (1.0 if make is gyro_pair else 0.5) for make, (_, k) in made.items())
        return told + (0.0 if mean is None else GRAVITY_WEIGHT * float(mean @ turn[:, 2]))

    scores = np.array([score(turn) for turn in ROTATIONS])
    first, second = np.argsort(-scores)[:2]
    best = ROTATIONS[first]
    if first == 0 or scores[first] < scores[0] + CLEARLY or scores[first] < scores[second] + ALONE:
        return None
    if mean is not None and mean @ best[:, 2] < GRAVITY_SHARE:
        return None
    turning = made[gyro_pair][1]
    if follows(ROTATIONS[0], turning) > follows(best, turning) + CLEARLY:
        return None  # gravity and gyro contradict each other: signs, and no turn
    seen: list[tuple[int, int, str]] = []
    if mean is not None and gravity is not None and best[2, 2] < 1.0:
        seen.append((gravity.axis, 2, f"gravity lies along {'-' * bool(gravity.sign < 0)}{IMU[1][gravity.axis]}"))
    for make, (sums, k) in made.items():
        at = int(np.argmax((best * k).sum(axis=(1, 2))))
        for i in range(3):
            j = int(np.argmax(np.abs(best[i])))
            value = float(best[i, j] * k[at, i, j])
            if value < -CLEAR and certain(sums, at, i, j):
                return None
            if value > CLEAR and certain(sums, at, i, j) and best[i, i] < 1.0:
                name = IMU[0 if make is gyro_pair else 1][i]
                seen.append((i, j, f"{name} follows {'-' * bool(best[i, j] < 0)}{'xyz'[j]} ({k[at, i, j]:+.2f})"))
    if len({entry[:2] for entry in seen}) < 2 and not any(i != j for i, j, _ in seen):
        return None
    vectors = tuple(v for make, v in zip((gyro_pair, force_pair), IMU, strict=True) if make in made or v[0] in
                    context.flight["imu"])
    return StreamTurn("imu", vectors, best.T, ", ".join(text for *_, text in seen))


def _imu_by_estimate(context: Context, mean: np.ndarray | None) -> StreamTurn | None:
    """The turn of the IMU without motion capture, by gravity (``mean``, its direction) and the estimated attitude."""
    turning = context.once(follows_estimate)
    if mean is None or turning is None:
        return None
    k = turning[0]
    best = max((turn for turn in ROTATIONS if mean @ turn[:, 2] > GRAVITY_SHARE), default=ROTATIONS[0],
               key=lambda turn: float((turn * k).sum()))
    seen = [(i, int(np.argmax(np.abs(best[i])))) for i in range(3)]
    clear = [(i, j) for i, j in seen if best[i, j] * k[i, j] > CLEAR]
    moved = [(i, j) for i, j in clear if best[i, i] < 1.0]
    if np.array_equal(best, ROTATIONS[0]) or len(clear) < 2 or not moved:
        return None
    if any(best[i, j] * k[i, j] < -CLEAR for i, j in seen):
        return None  # a mirror image, which no turn explains
    axis = int(np.argmax(np.abs(mean)))
    why = [f"gravity lies along {'-' * bool(mean[axis] < 0)}{IMU[1][axis]}",
           *(f"{IMU[0][i]} follows {'-' * bool(best[i, j] < 0)}{'xyz'[j]} of the estimated attitude ({k[i, j]:+.2f})"
             for i, j in moved)]
    return StreamTurn("imu", IMU, best.T, ", ".join(why))


def in_words(turn: np.ndarray) -> str:
    """``180 deg about x``."""
    vector = Rotation.from_matrix(turn).as_rotvec()
    angle = float(np.linalg.norm(vector))
    axis = np.round(vector / max(np.abs(vector).max(), 1e-9)).astype(int)
    lone = np.flatnonzero(axis)
    name = f"({', '.join(map(str, axis))})"
    if len(lone) == 1:
        backward = axis[lone[0]] < 0 and round(np.degrees(angle)) != 180
        name = "-" * bool(backward) + "xyz"[lone[0]]
    return f"{np.degrees(angle):.0f} deg about {name}"


def assignments(turn: np.ndarray, names: tuple[str, ...]) -> list[tuple[str, int, str]]:
    """(quantity, sign, quantity as stored) of what a turn moves in one vector, as a column map writes it."""
    found = []
    for i in range(3):
        j = int(np.argmax(np.abs(turn[i])))
        if turn[i, i] < 1.0:
            found.append((names[i], int(turn[i, j]), names[j]))
    return found


def how(turn: np.ndarray, vectors: tuple[tuple[str, ...], ...]) -> str:
    """What to change: signs where no axis moves, else which column is which."""
    moves = [move for names in vectors for move in assignments(turn, names)]
    if all(new == old for new, _, old in moves):
        return f"change the sign of {', '.join(new for new, *_ in moves)}"
    return "read " + ", ".join(f"{new} = {'-' * bool(sign < 0)}{old}" for new, sign, old in moves)

"""Axes of a drafted map that the numbers show: velocity, specific force and turning rate in body or world axes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import permutations, product

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

from ..settings import number
from . import column_evidence as evidence
from .draft import PITCH_ASSUMED, QUATERNION, Draft, Key
from .flown_axes import UP, tilts_of
from .quaternion_reading import CLEARLY, FITS

SAME_AXES = number("audit.draft_axes.same_axes")
OTHER_AXES = number("audit.draft_axes.other_axes")
FAR_BETTER = number("audit.draft_axes.far_better")
LEAST_TURN_RAD = number("audit.draft_axes.least_turn_rad")
SPAN_S = 0.5
"""A displacement over this time contains little noise of the positions."""
TURN_S = 0.1
"""The same for turning rates."""
DOWN = "NED"
UPWARDS = 0.9
"""Share of the mean specific force that points upwards, where attitude and accelerometer have the same body axes."""
ANGLES = ("roll", "pitch", "yaw")
AS_STORED = ("", 1.0, 1.0)
NOSE_UP = ("", 1.0, -1.0)

TURNED_PITCH = "is positive"
"""Words on a pitch that got its other sign."""

def judge_axes(draft: Draft, values: Mapping[str, np.ndarray], time_s: np.ndarray) -> None:
    """Omits vectors that are in other axes than their quantity, and asks about those that agree with neither."""
    steps = np.diff(time_s)
    if len(time_s) < 4 * evidence.WINDOW or not np.isfinite(steps).all() or not np.median(steps) > 0.0:
        return
    step_s = float(np.median(steps))
    _body_down(draft, values)
    _angle_signs(draft, values, step_s)
    rotation = rotation_of(draft, values)
    for position, velocity in (((("mocap", "px"), ("mocap", "py"), ("mocap", "pz")),
                                (("mocap", "vx"), ("mocap", "vy"), ("mocap", "vz"))),
                               ((("estimator", "x"), ("estimator", "y"), ("estimator", "z")),
                                (("estimator", "vx"), ("estimator", "vy"), ("estimator", "vz")))):
        _velocity(draft, values, position, velocity, rotation, step_s)
    if rotation is not None:
        _force(draft, values, rotation, step_s)
        _rate(draft, values, rotation, step_s)


def _body_down(draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    """A body whose z points down in a world whose z does: gravity lies along -z of the accelerometer, and the attitude
    turns it upwards."""
    turn, force = [("mocap", q) for q in QUATERNION], [("imu", f"acc_{a}") for a in "xyz"]
    if draft.frames.get("mocap") != DOWN or "imu" in draft.frames or not all(k in draft.mapped for k in turn + force):
        return
    q, f = draft.si(turn, values), draft.si(force, values)
    rows = np.isfinite(q).all(axis=1) & np.isfinite(f).all(axis=1) & (np.linalg.norm(q, axis=1) > 0.5)
    if not rows.any():
        return
    world = Rotation.from_quat(q[rows]).apply(f[rows]).mean(axis=0)
    if np.median(f[rows, 2]) < 0.0 and world[2] < -UPWARDS * float(np.linalg.norm(world)):
        draft.frames["mocap"], draft.frames["imu"] = f"{DOWN}/FRD", "FRD"
        draft.notes[:] = [note for note in draft.notes if not note.startswith("p, q, r:")]
        draft.notes.append("mocap: NED/FRD, and imu: FRD, since z of accelerometer and attitude point down")


def rotation_of(draft: Draft, values: Mapping[str, np.ndarray]) -> Rotation | None:
    """Body to world, (n,); None without an attitude in every row."""
    for stream in ("mocap", "attitude_qw"):
        turn = _vector(draft, values, [(stream, q) for q in QUATERNION])
        if turn is not None and np.linalg.norm(turn, axis=1).min() > 0.5:
            return Rotation.from_quat(turn)
    angles = _vector(draft, values, [("attitude", name) for name in ANGLES])
    return None if angles is None else Rotation.from_euler("ZYX", angles[:, ::-1])


def _vector(draft: Draft, values: Mapping[str, np.ndarray], keys: list[Key] | tuple[Key, ...],
            turned: bool = False) -> np.ndarray | None:
    """(n, k) in SI; None where a column is not drafted, a cell is missing, or the axes are not ours (unless
    ``turned``)."""
    if not all(key in draft.mapped for key in keys) or (not turned and any(key[0] in draft.frames for key in keys)):
        return None
    found = draft.si(keys, values)
    return found if np.isfinite(found).all() else None


def explained(signal: np.ndarray, by: np.ndarray) -> float:
    """Share of the mean square of (n, 3) ``signal`` that ``by`` explains, constants removed."""
    signal, by = signal - signal.mean(axis=0), by - by.mean(axis=0)
    size = float(np.sum(signal * signal))
    return 1.0 - float(np.sum((signal - by) ** 2)) / size if size > 0.0 else 1.0


def far_better(one: float, other: float) -> bool:
    """Whether the first share explains the motion, and leaves a fraction of what the second one leaves."""
    return one > SAME_AXES and 1.0 - other > FAR_BETTER * (1.0 - one)


def _velocity(draft: Draft, values: Mapping[str, np.ndarray], position: tuple[Key, ...], velocity: tuple[Key, ...],
              rotation: Rotation | None, step_s: float) -> None:
    p, v = _vector(draft, values, position, True), _vector(draft, values, velocity, True)
    rows = round(SPAN_S / step_s)
    if p is None or v is None or not 0 < rows < len(p) // 2:
        return
    moved = p[rows:] - p[:-rows]
    if float(np.sqrt(np.mean(moved ** 2))) < SPAN_S * evidence.SMALLEST_FLIGHT_M:
        return

    def of(speed: np.ndarray) -> float:
        path = step_s * np.cumsum(speed, axis=0)
        return explained(moved, path[rows:] - path[:-rows])

    world = of(v)
    if rotation is not None and position[0][0] not in draft.frames and far_better(of(rotation.apply(v)), world):
        for key in velocity:
            draft.unknown[draft.mapped.pop(key).column] = "a velocity in the body frame, which no task uses"
        draft.notes.append("the velocity is in body axes: turned by the attitude it is the rate of the position")
    elif world < OTHER_AXES:
        named = position[0][0] in draft.frames and draft.mapped[velocity[0]].status != "known"
        mixed = not named and any(far_better(of(v[:, order] * signs), world) for order in permutations(range(3))
                    for signs in product((1.0, -1.0), repeat=3))
        draft.ask([*position, *velocity] if mixed else velocity,
                  "this is not the rate of the position: in other axes, or of another body?" if not mixed else
                  "the velocity is the rate of the position with other signs or axes; which is wrong?")


def _force(draft: Draft, values: Mapping[str, np.ndarray], rotation: Rotation, step_s: float) -> None:
    """A specific force in world axes explains the acceleration of the path as it is."""
    keys = [("imu", f"acc_{a}") for a in "xyz"]
    p, f = _vector(draft, values, [("mocap", f"p{a}") for a in "xyz"]), _vector(draft, values, keys)
    rows = round(SPAN_S / step_s)
    if p is None or f is None or not 0 < rows < len(p) // 4:
        return
    bent = p[2 * rows:] - 2.0 * p[rows:-rows] + p[:-2 * rows]

    def of(force: np.ndarray) -> float:
        twice = uniform_filter1d(uniform_filter1d(force, rows, axis=0), rows, axis=0)
        return explained(bent, (rows * step_s) ** 2 * twice[rows:-rows])

    if far_better(of(f), of(rotation.apply(f))):
        draft.ask(keys, "an acceleration in the axes of the world, not of the body; leave it out, or turn it by the "
                        "attitude")


def _rate(draft: Draft, values: Mapping[str, np.ndarray], rotation: Rotation, step_s: float) -> None:
    """A turning rate in world axes explains the turning of the attitude there, and not in the body."""
    keys = [("imu", f"gyro_{a}") for a in "xyz"]
    w = _vector(draft, values, keys)
    rows = max(1, round(TURN_S / step_s))
    if w is None or rows >= len(w) // 4:
        return
    body = (rotation[:-rows].inv() * rotation[rows:]).as_rotvec()
    world = (rotation[rows:] * rotation[:-rows].inv()).as_rotvec()
    path = step_s * np.cumsum(w, axis=0)
    turned = path[rows:] - path[:-rows]
    if far_better(explained(world, turned), explained(body, turned)):
        draft.ask(keys, "turning rates in the axes of the world, not of the body; leave them out, or turn them by the "
                        "attitude")


def _angle_signs(draft: Draft, values: Mapping[str, np.ndarray], step_s: float) -> None:
    """The gyro shows the sign of every angle, also of one with a known name, which its user may have turned. A pitch
    alone gets the other sign; anything else is a question."""
    angles = _vector(draft, values, [("attitude", name) for name in ANGLES])
    w = _vector(draft, values, [("imu", f"gyro_{a}") for a in "xyz"])
    if angles is None:
        return
    if w is None:
        _angle_signs_by_path(draft, values, angles, step_s)
        return
    rows = max(1, round(TURN_S / step_s))
    turns = np.unwrap(angles, axis=0)
    path = step_s * np.cumsum(w, axis=0)
    found = evidence.ratio(path[rows:] - path[:-rows], turns[rows:] - turns[:-rows])
    crossed = evidence.ratio(path[rows:] - path[:-rows], (turns[rows:] - turns[:-rows])[:, [1, 0, 2]])
    if found.sign[:2] == (0, 0) and 0 not in crossed.sign[:2]:
        draft.ask([("attitude", "roll"), ("attitude", "pitch"), ("imu", "gyro_x"), ("imu", "gyro_y")],
                  "the gyro turns about x as the pitch and about y as the roll: which two columns changed places?")
        return
    force = draft.mapped.get(("imu", "acc_z"))
    z_up = force is not None and float(np.nanmedian(force.sign * values[force.column])) > 0.0  # for the gyro as well
    against = [axis for axis, sign in enumerate(found.sign) if sign < 0]
    if against == [ANGLES.index("pitch")] and found.sign[0] > 0:
        follows = _follows(draft, values, angles, step_s)
        if follows and follows[AS_STORED] > max(FITS, follows[NOSE_UP] + CLEARLY):
            draft.ask([("imu", "gyro_y")], "it turns against the pitch, with which the vehicle speeds up towards its "
                      "tilt; write sign = -1 there if it is negated")
        else:
            _turn_pitch(draft, "the gyro turns the other way", z_up or follows.get(NOSE_UP, -1.0) > FITS)
    elif against:
        unclear = [axis for axis, sign in enumerate(found.sign) if sign == 0]
        draft.ask([key for axis in sorted([*against, *unclear])
                   for key in (("attitude", ANGLES[axis]), ("imu", f"gyro_{'xyz'[axis]}"))],
                  "the gyro turns against the attitude; which is negated? write sign = -1 there"
                  + (', or frame = "FRD" in [streams.imu]' if against == [1, 2] else ""))
    elif found.sign[:2] == (1, 1):
        if z_up:
            draft.notes[:] = [n for n in draft.notes if PITCH_ASSUMED not in n]
        _body_by_path(draft, _follows(draft, values, angles, step_s))


def _body_by_path(draft: Draft, follows: Mapping[tuple[str, float, float], float]) -> None:
    """Angles and a gyro that agree may both be of a body whose z points down: the path shows it."""
    if not follows:
        return
    stored, best = follows[AS_STORED], max(follows.values())
    if best > max(FITS, stored + CLEARLY):
        draft.ask([*draft.columns("attitude", ANGLES), *draft.columns("imu", [f"gyro_{a}" for a in "xyz"])],
                  "the gyro turns with the angles, but the vehicle speeds up against their tilt. Is z of the body "
                  'down? If so, write frame = "FRD" in [streams.imu], and sign = -1 at pitch and yaw')
    elif stored > FITS:
        draft.notes[:] = [n for n in draft.notes if PITCH_ASSUMED not in n]


def _follows(draft: Draft, values: Mapping[str, np.ndarray], angles: np.ndarray, step_s: float
             ) -> dict[tuple[str, float, float], float]:
    """(reading of the yaw, sign of roll, of pitch) -> correlation of tilt and acceleration; empty without a path."""
    path = _vector(draft, values, [("mocap", f"p{a}") for a in "xyz"])
    if path is None:
        return {}
    follows = {}
    yaws = {"": angles[:, 2], "clockwise from x": -angles[:, 2],
            "clockwise from y, as a compass": np.pi / 2 - angles[:, 2]}
    for reading, roll, pitch in product(yaws, (1.0, -1.0), (1.0, -1.0)):
        read = np.stack([yaws[reading], pitch * angles[:, 1], roll * angles[:, 0]], axis=1)
        turn = Rotation.from_euler("ZYX", read).as_quat()
        tilt = tilts_of(step_s * np.arange(len(path)), path, turn).get((UP, UP))
        follows[reading, roll, pitch] = -1.0 if tilt is None or math.isnan(tilt.each) else tilt.each
    return follows


def _angle_signs_by_path(draft: Draft, values: Mapping[str, np.ndarray], angles: np.ndarray, step_s: float) -> None:
    """Without a gyro the path shows the signs: the vehicle speeds up towards the side to which it tilts."""
    follows = _follows(draft, values, angles, step_s)
    if not follows:
        return
    stored = [signs for signs in follows if not signs[0]]
    best, any_best = (max(of, key=follows.__getitem__) for of in (stored, follows))
    turned = float(np.ptp(np.quantile(np.unwrap(angles[:, 2]), (0.05, 0.95))))
    if any_best[0] and turned > LEAST_TURN_RAD and follows[any_best] > max(FITS, follows[best] + CLEARLY):
        draft.ask([("attitude", "yaw")], "the vehicle speeds up towards its tilt where the yaw is counted "
                  f"{any_best[0]}; write it counter-clockwise from x (sign = -1 and offset in rad)")
        return
    if not follows[best] > FITS:
        return
    if best == AS_STORED:
        draft.notes[:] = [n for n in draft.notes if PITCH_ASSUMED not in n]
    elif best == NOSE_UP:
        _turn_pitch(draft, "the vehicle speeds up the other way", shown=True)
    else:
        draft.ask([("attitude", name) for name in ANGLES], "the vehicle accelerates against its tilt: is an angle or a "
                  "position negated (write sign = -1 there)? Or do the two have different headings?")


def _turn_pitch(draft: Draft, why: str, shown: bool) -> None:
    """Gives the pitch its other sign. It is assumed where nothing but one gyro shows it, which may be negated."""
    key: Key = ("attitude", "pitch")
    drafted = draft.mapped[key]
    nose = "up" if drafted.sign > 0 else "down"
    other = f", unlike in {drafted.why}" if drafted.status == "known" and drafted.why != "stated" else ""
    assumed = bool(other) or not shown
    status = "assumed" if assumed or drafted.status == "assumed" else "shown"
    draft.mapped[key] = replace(drafted, sign=-drafted.sign, status=status, why=f"nose {nose} {TURNED_PITCH}: {why}")
    draft.notes[:] = [n for n in draft.notes if not n.startswith(f"{drafted.column}: taken as positive")]
    draft.notes.append(f"{drafted.column}: positive nose {nose}{other}, since {why}{'; check it' * assumed}")

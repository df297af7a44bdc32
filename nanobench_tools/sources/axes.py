"""Frames of other programs, named by where their axes point, and the turn from them to those of ``frames``.

A world is three letters of north/south, east/west, up/down (``NED``, ``NWU``, ``EUS``). A body is three of
forward/back, left/right, up/down (``FRD``, ``RFU``). ``NED/FRD`` names both, as a column map writes it. Ours is
``ENU/FLU``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from .. import so3
from ..errors import UsageError
from ..flight import Stream

_WORLD = {"E": (0, 1.0), "W": (0, -1.0), "N": (1, 1.0), "S": (1, -1.0), "U": (2, 1.0), "D": (2, -1.0)}
_BODY = {"F": (0, 1.0), "B": (0, -1.0), "L": (1, 1.0), "R": (1, -1.0), "U": (2, 1.0), "D": (2, -1.0)}
WORLD_VECTORS = (("px", "py", "pz"), ("x", "y", "z"), ("vx", "vy", "vz"), ("ax", "ay", "az"))
BODY_VECTORS = (("acc_x", "acc_y", "acc_z"), ("gyro_x", "gyro_y", "gyro_z"), ("wx", "wy", "wz"))
QUATERNION = ("qx", "qy", "qz", "qw")
EULER = ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class Frame:
    """``name`` as written; world, body (3, 3): columns of a vector in the named axes to ours, v_ours = world @ v."""

    name: str
    world: np.ndarray
    body: np.ndarray


def frame_of(name: str) -> Frame:
    """The frame called ``NED``, ``FRD``, ``NED/FRD`` ...; a part that is not given is ours. UsageError for any other
    word."""
    parts = name.strip().upper().split("/")
    world = body = np.eye(3)
    if len(parts) > 2:
        parts = [name]
    if len(parts) == 2:
        world, body = _matrix(parts[0], _WORLD, name), _matrix(parts[1], _BODY, name)
    elif set(parts[0]) <= set(_WORLD):
        world = _matrix(parts[0], _WORLD, name)
    else:
        body = _matrix(parts[0], _BODY, name)
    return Frame(name, world, body)


def _matrix(letters: str, directions: dict[str, tuple[int, float]], name: str) -> np.ndarray:
    found = np.zeros((3, 3))
    for column, letter in enumerate(letters[:3]):
        if letter in directions:
            row, sign = directions[letter]
            found[row, column] = sign
    if len(letters) != 3 or not np.isclose(np.linalg.det(found), 1.0):
        raise UsageError(f"frame {name!r}: no right-handed axes; write for example NED/FRD, ENU/FLU or EUS (y up)")
    return found


def name_of(turn: np.ndarray, world: bool) -> str:
    """The letters of axes whose vectors ``turn`` (3, 3) takes to ours, as ``frame_of`` reads them.

    >>> name_of(np.diag([1.0, -1.0, -1.0]), world=False)
    'FRD'
    """
    letters = {place: letter for letter, place in (_WORLD if world else _BODY).items()}
    rows = np.abs(turn).argmax(axis=0)
    return "".join(letters[int(row), float(turn[row, column])] for column, row in enumerate(rows))


def in_our_axes(stream: Stream, frame: Frame) -> Stream:
    """``stream``, recorded in ``frame``, in the axes of ``frames``.

    Vectors may lack axes. Euler angles (ZYX) need all three, or yaw alone where both frames have an upward or a
    downward z. UsageError names what is missing.
    """
    values = stream.values.copy()
    quantities = list(stream.quantities)
    for vectors, turn in ((WORLD_VECTORS, frame.world), (BODY_VECTORS, frame.body)):
        for names in vectors:
            _turn_vector(names, turn, stream, values, quantities)
    world, body = Rotation.from_matrix(frame.world), Rotation.from_matrix(frame.body)
    if any(q in stream for q in QUATERNION):
        _whole(stream, QUATERNION, frame)
        at = [stream.index(q) for q in QUATERNION]
        values[:, at] = _turned(world, stream.values[:, at], body)
    if any(q in stream.quantities for q in EULER):
        if stream.quantities.count("yaw") and not {"roll", "pitch"} & set(stream.quantities):
            values[:, stream.index("yaw")] = _yaw(stream["yaw"], frame)
        else:
            _whole(stream, EULER, frame)
            at = [stream.index(q) for q in EULER]
            values[:, at] = so3.euler_zyx(_turned(world, so3.from_euler_zyx(*stream.values[:, at].T), body))
    order = sorted(range(len(quantities)), key=lambda k: (*stream.quantities, *quantities).index(quantities[k]))
    return replace(stream, values=values[:, order], quantities=tuple(quantities[k] for k in order),
                   columns=tuple(stream.columns[k] for k in order), unit=tuple(stream.unit[k] for k in order))


def _turn_vector(names: Sequence[str], turn: np.ndarray, stream: Stream, values: np.ndarray,
                 quantities: list[str]) -> None:
    """Each of our axes is one of theirs with a sign: the column keeps its place and gets the other axis's name."""
    for theirs, name in enumerate(names):
        if name in stream.quantities:
            at = stream.index(name)
            ours = int(np.argmax(np.abs(turn[:, theirs])))
            values[:, at] = turn[ours, theirs] * stream.values[:, at]
            quantities[at] = names[ours]


def _whole(stream: Stream, names: Sequence[str], frame: Frame) -> None:
    if missing := [q for q in names if q not in stream.quantities]:
        raise UsageError(f"frame {frame.name!r} cannot turn {', '.join(q for q in names if q in stream.quantities)} "
                         f"without {', '.join(missing)}")


def _turned(world: Rotation, quaternion: np.ndarray, body: Rotation) -> np.ndarray:
    """(n, 4) their body to their world -> (n, 4) ours to ours; rows without a rotation are NaN."""
    found = np.full(quaternion.shape, np.nan)
    norm = np.linalg.norm(quaternion, axis=1)
    there = np.isfinite(norm) & (norm > 0.0)
    if there.any():
        found[there] = (world * Rotation.from_quat(quaternion[there]) * body.inv()).as_quat() * norm[there, None]
    return found


def _yaw(yaw: np.ndarray, frame: Frame) -> np.ndarray:
    """Yaw alone, about their z, as yaw about ours."""
    up = frame.world[2, 2]
    if abs(up) < 1.0 or frame.body[2, 2] != up:
        raise UsageError(f"frame {frame.name!r} cannot turn yaw without roll and pitch")
    level = np.zeros_like(yaw)
    turned = _turned(Rotation.from_matrix(frame.world), so3.from_euler_zyx(level, level, yaw),
                     Rotation.from_matrix(frame.body))
    return np.asarray(so3.euler_zyx(turned)[:, 2])

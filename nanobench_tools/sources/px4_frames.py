"""From PX4's axes to those of ``frames``, stated once.

PX4's world is north, east, down (NED; or forward, right, down where heading is arbitrary) and its body forward, right,
down (FRD). Ours: x east, y north, z up (ENU) and forward, left, up (FLU). So a vehicle that is level and faces north
has yaw +90 deg here, one that faces east yaw 0, a turn to the right lowers yaw, a climb is positive and a vehicle at
rest measures +9.81 m/s^2 along z. PX4 writes quaternions w, x, y, z, from body to world.
"""

from __future__ import annotations

import math

import numpy as np

from .. import so3

_HALF = math.sqrt(0.5)
WORLD_TURN = np.array([_HALF, _HALF, 0.0, 0.0])
"""NED to ENU as x, y, z, w: half a turn about north-east."""
BODY_TURN = np.array([1.0, 0.0, 0.0, 0.0])
"""FLU to FRD as x, y, z, w: half a turn about forward."""
WORLD_ORDER = (1, 0, 2)
"""Which element of a NED vector each of ours comes from."""


def world_vectors(ned: np.ndarray) -> np.ndarray:
    """(n, 3) north, east, down -> (n, 3) east, north, up; any unit."""
    return np.asarray(ned, float)[:, WORLD_ORDER] * [1.0, 1.0, -1.0]


def body_vectors(frd: np.ndarray) -> np.ndarray:
    """(n, 3) forward, right, down -> (n, 3) forward, left, up; any unit."""
    return np.asarray(frd, float) * [1.0, -1.0, -1.0]


def quaternions(wxyz: np.ndarray) -> np.ndarray:
    """(n, 4) w, x, y, z, FRD to NED -> (n, 4) x, y, z, w, FLU to ENU."""
    q = np.asarray(wxyz, float)[:, [1, 2, 3, 0]]
    return so3.multiply(so3.multiply(WORLD_TURN, q), BODY_TURN)


def world_yaw(yaw: np.ndarray) -> np.ndarray:
    """(n,) rad clockwise from north -> counter-clockwise from east, in -pi..pi."""
    return np.asarray(so3.wrap_angle(0.5 * math.pi - np.asarray(yaw, float)))

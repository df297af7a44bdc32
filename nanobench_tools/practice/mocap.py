"""What the motion capture writes: noisy poses, and velocities and rates made from them as in the published files."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from .. import so3
from ..settings import number, setting

WINDOW, ORDER = 11, 3
"""Savitzky-Golay filter of the published velocity and rate columns; it counts rows, so lost frames distort it."""


@dataclass(frozen=True)
class MocapNoise:
    """White noise per frame: position (m) and attitude about x, y and z of the body (rad).

    The recordings show 0.012 mm and, at rest, 0.012, 0.055, 0.020 deg; roll is noisier in the air.
    """

    position_m: float = number("practice.mocap.mocapnoise_position_m")
    attitude_rad: tuple[float, float, float] = setting("practice.mocap.mocapnoise_attitude_rad")


def savgol_derivative(rows_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """First derivative (n, k) by rows, with the median step of ``rows_s`` (n,)."""
    return np.asarray(savgol_filter(values, WINDOW, ORDER, deriv=1, delta=float(np.median(np.diff(rows_s))), axis=0))


def body_rate(rows_s: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """Body rates (n, 3) rad/s from quaternions (n, 4): 2 q^-1 dq with the filter on sign-continuous q."""
    q = so3.make_continuous(quaternion)
    return 2.0 * so3.multiply(so3.conjugate(q), savgol_derivative(rows_s, q))[:, :3]


def mocap_values(rows_s: np.ndarray, position: np.ndarray, quaternion: np.ndarray, tilt_rad: np.ndarray,
                 noise: MocapNoise, rng: np.random.Generator) -> np.ndarray:
    """The 16 columns (m, 16) of the mocap stream from true poses (m, 3), (m, 4).

    tilt_rad (3,) is the rotation vector from the IMU's body frame to the tracked one. Printed like the source:
    position to 1e-6 m, quaternion to 1e-8, Euler angles to 1e-6 rad.
    """
    shake = rng.standard_normal((len(rows_s), 6))
    p = np.round(position + noise.position_m * shake[:, :3], 6)
    angles = shake[:, 3:] * np.asarray(noise.attitude_rad)
    q = so3.multiply(so3.multiply(quaternion, so3.exp(tilt_rad)), so3.exp(angles))
    q = np.round(so3.make_continuous(q * np.where(q[:1, 3:] < 0.0, -1.0, 1.0)), 8)
    euler = np.round(so3.euler_zyx(q), 6)
    return np.concatenate([p, q, euler, savgol_derivative(rows_s, p), body_rate(rows_s, q)], axis=1)

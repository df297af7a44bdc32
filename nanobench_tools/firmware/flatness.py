"""Body rates that a path asks for (pptraj.c, piecewise polynomial evaluation): the thrust has to turn with the jerk."""

from __future__ import annotations

import numpy as np

from ..units import GRAVITY_M_S2


def body_rates(acceleration_m_s2: np.ndarray, jerk_m_s3: np.ndarray, yaw_rad: np.ndarray,
               yaw_rate_rad_s: np.ndarray) -> np.ndarray:
    """Acceleration, jerk (n, 3) world, yaw [rad] and its rate (n,) -> rates (n, 3) rad/s of the body that flies it.

    With t = a + g e3, z = t/|t|, y = z x (cos yaw, sin yaw, 0) normalised, x = y x z, h = (j - (j.z) z)/|t|:
    (-h.y, h.x, z_z yaw_rate). Zero where the path asks for free fall or for thrust along the heading.
    """
    thrust = acceleration_m_s2 + np.array([0.0, 0.0, GRAVITY_M_S2])
    length = np.linalg.norm(thrust, axis=1, keepdims=True)
    z = thrust / np.where(length > 0.0, length, 1.0)
    heading = np.stack([np.cos(yaw_rad), np.sin(yaw_rad), np.zeros_like(yaw_rad)], axis=1)
    y = np.cross(z, heading)
    side = np.linalg.norm(y, axis=1, keepdims=True)
    y = y / np.where(side > 0.0, side, 1.0)
    h = (jerk_m_s3 - np.sum(jerk_m_s3 * z, axis=1, keepdims=True) * z) / np.where(length > 0.0, length, np.inf)
    return np.stack([-np.sum(h * y, axis=1), np.sum(h * np.cross(y, z), axis=1), z[:, 2] * yaw_rate_rad_s], axis=1)

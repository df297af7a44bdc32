"""Errors of attitude: the angle between two rotations, and Euler angles per axis.

The geodesic angle is the one that does not depend on the choice of axes; Euler errors are what firmware logs.
"""

import numpy as np

from .. import so3
from .alignment import checked_pair
from .trajectory import rms


def geodesic_errors(estimate_q: np.ndarray, truth_q: np.ndarray) -> np.ndarray:
    """(n,) rad, 0..pi: angle of R^T R_est; both (n, 4) x, y, z, w body to world; q and -q are the same."""
    return so3.geodesic_angle(*checked_pair(truth_q, estimate_q, 4))


def geodesic_rmse(estimate_q: np.ndarray, truth_q: np.ndarray) -> float:
    """RMS of ``geodesic_errors`` [rad]."""
    return rms(geodesic_errors(estimate_q, truth_q))


def euler_errors(estimate_rad: np.ndarray, truth_rad: np.ndarray) -> np.ndarray:
    """(n, 3) rad in [-pi, pi): roll, pitch, yaw differences, wrapped; both (n, 3) rad, ZYX."""
    estimate, truth = checked_pair(estimate_rad, truth_rad)
    return np.asarray(so3.wrap_angle(estimate - truth))


def published_euler_rmse_deg(estimate_deg: np.ndarray, truth_rad: np.ndarray) -> float:
    """NanoBench's published attitude "error": sqrt(mean over rows and axes of wrap180(estimate_deg - truth_rad)^2).

    estimate_deg (n, 3): roll, pitch, yaw as the firmware logs them, degrees, nose up positive; truth_rad (n, 3) mocap
    angles in radians, nose down positive. The difference mixes both units and signs: kept only to reproduce the table.
    """
    estimate, truth = checked_pair(estimate_deg, truth_rad)
    return rms((estimate - truth + 180.0) % 360.0 - 180.0)


def without_constant_rotation(estimate_q: np.ndarray, truth_q: np.ndarray) -> np.ndarray:
    """(n, 4): estimate_q q_c with the one body rotation q_c that brings it closest to the truth (chordal mean).

    Removes the constant rotation between mocap body frame and sensor; both (n, 4). It is q_c, the mean of
    conj(estimate_q) truth_q. Source: Markley et al. 2007 (largest eigenvector of the sum of outer products, blind to
    the sign of each).
    """
    estimate, truth = checked_pair(estimate_q, truth_q, 4)
    offsets = so3.multiply(so3.conjugate(estimate), truth)
    constant = np.linalg.eigh(offsets.T @ offsets)[1][:, -1]
    return so3.multiply(estimate, constant)

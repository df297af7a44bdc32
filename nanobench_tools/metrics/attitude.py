"""Errors of attitude: the angle between two rotations, and Euler angles per axis.

The geodesic angle is the one that does not depend on the choice of axes; Euler errors are what firmware logs.
"""

import numpy as np

from .. import so3
from .alignment import checked_pair
from .trajectory import rms


def geodesic_errors(estimate_q: np.ndarray, truth_q: np.ndarray) -> np.ndarray:
    """Compute the angle of R^T R_est. q and -q are the same attitude.

    Parameters
    ----------
    estimate_q, truth_q : ndarray
        (n, 4) x, y, z, w, body to world.

    Returns
    -------
    ndarray
        (n,) 0 to pi rad.

    Raises
    ------
    ValueError
        For other shapes, no rows, or values that are not finite.
    """
    return so3.geodesic_angle(*checked_pair(truth_q, estimate_q, 4))


def geodesic_rmse(estimate_q: np.ndarray, truth_q: np.ndarray) -> float:
    """Compute the root mean square of ``geodesic_errors``.

    Parameters
    ----------
    estimate_q, truth_q : ndarray
        (n, 4) x, y, z, w, body to world.

    Returns
    -------
    float
        rad.

    Raises
    ------
    ValueError
        For other shapes, no rows, or values that are not finite.
    """
    return rms(geodesic_errors(estimate_q, truth_q))


def euler_errors(estimate_rad: np.ndarray, truth_rad: np.ndarray) -> np.ndarray:
    """Compute differences of roll, pitch and yaw, wrapped.

    Parameters
    ----------
    estimate_rad, truth_rad : ndarray
        (n, 3) rad, ZYX.

    Returns
    -------
    ndarray
        (n, 3) rad, in [-pi, pi).

    Raises
    ------
    ValueError
        For other shapes, no rows, or values that are not finite.
    """
    estimate, truth = checked_pair(estimate_rad, truth_rad)
    return np.asarray(so3.wrap_angle(estimate - truth))


def published_euler_rmse_deg(estimate_deg: np.ndarray, truth_rad: np.ndarray) -> float:
    """Compute NanoBench's published attitude "error": sqrt(mean over rows and axes of wrap180(estimate_deg -
    truth_rad)^2).

    The difference mixes units and signs. It is kept only to reproduce the table.

    Parameters
    ----------
    estimate_deg : ndarray
        (n, 3) roll, pitch, yaw as the firmware logs them, degrees, nose up positive.
    truth_rad : ndarray
        (n, 3) angles of the motion capture, rad, nose down positive.

    Returns
    -------
    float
        Of a mixed unit.

    Raises
    ------
    ValueError
        For other shapes, no rows, or values that are not finite.
    """
    estimate, truth = checked_pair(estimate_deg, truth_rad)
    return rms((estimate - truth + 180.0) % 360.0 - 180.0)


def without_constant_rotation(estimate_q: np.ndarray, truth_q: np.ndarray) -> np.ndarray:
    """Return the estimate turned by the one constant body rotation that brings it closest to the truth (chordal mean).

    It removes the constant rotation between mocap body frame and sensor. That is the mean of conj(estimate_q)
    truth_q, the largest eigenvector of the sum of outer products.

    Parameters
    ----------
    estimate_q, truth_q : ndarray
        (n, 4) x, y, z, w, body to world.

    Returns
    -------
    ndarray
        (n, 4) x, y, z, w.

    Raises
    ------
    ValueError
        For other shapes, no rows, or values that are not finite.

    References
    ----------
    Markley et al. 2007, "Averaging quaternions", Journal of Guidance, Control, and Dynamics 30(4).
    """
    estimate, truth = checked_pair(estimate_q, truth_q, 4)
    offsets = so3.multiply(so3.conjugate(estimate), truth)
    constant = np.linalg.eigh(offsets.T @ offsets)[1][:, -1]
    return so3.multiply(estimate, constant)

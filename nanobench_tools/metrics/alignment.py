"""Rigid alignment of two point sets: which rotation and shift lay an estimated path onto the true one.

Without scale, the solution of Umeyama equals those of Horn 1987 and Kabsch 1976.

References
----------
- Umeyama 1991, "Least-squares estimation of transformation parameters between two point patterns", IEEE TPAMI 13(4),
  eqs. 34-43.
- Zhang, Scaramuzza 2018, "A tutorial on quantitative trajectory evaluation for visual(-inertial) odometry", IROS,
  section III: position and yaw.
"""

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import NanobenchError

MODES = ("se3", "yaw", "none")
"""``se3``: any rotation and shift; ``yaw``: rotation about the vertical and shift; ``none``: as it is."""

_RANK_TOLERANCE = 1e-12  # of the larger spread; rounding of coordinates leaves about 1e-16


class AlignmentError(NanobenchError, ValueError):
    """The points do not determine the rotation: they are too few, one point, or on one line."""


@dataclass(frozen=True)
class Alignment:
    """The motion x -> rotation x + translation_m.

    Attributes
    ----------
    rotation : ndarray
        (3, 3).
    translation_m : ndarray
        (3,) m.
    """

    rotation: np.ndarray
    translation_m: np.ndarray

    def apply(self, points_m: np.ndarray) -> np.ndarray:
        """Move points.

        Parameters
        ----------
        points_m : ndarray
            (n, 3) m.

        Returns
        -------
        ndarray
            (n, 3) m.
        """
        return np.asarray(points_m @ self.rotation.T + self.translation_m)

    @property
    def angle_rad(self) -> float:
        """Angle of the rotation, 0 to pi rad."""
        sine = np.linalg.norm([self.rotation[2, 1] - self.rotation[1, 2], self.rotation[0, 2] - self.rotation[2, 0],
                               self.rotation[1, 0] - self.rotation[0, 1]])
        return float(np.arctan2(sine, np.trace(self.rotation) - 1.0))


def align(estimate_m: np.ndarray, truth_m: np.ndarray, mode: str = "se3", unique: bool = True) -> Alignment:
    """Return the rigid motion (R, t) that minimises sum |R estimate_i + t - truth_i|^2 over rows.

    Parameters
    ----------
    estimate_m, truth_m : ndarray
        (n, 3) m, row by row at the same times.
    mode : str
        ``se3``: any rotation and shift; ``yaw``: rotation about the vertical and shift; ``none``: no motion.
    unique : bool
        False: one of the best motions is enough. Turning a line about itself leaves every error as it is.

    Returns
    -------
    Alignment
        The motion.

    Raises
    ------
    AlignmentError
        Where the rotation is not determined and ``unique``: a single point, or for ``se3`` a straight line.
    ValueError
        For an unknown mode, other shapes, no rows, or values that are not finite.

    Examples
    --------
    >>> square = np.array([[0., 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> align(square, square + [0, 0, 2]).translation_m.round(9).tolist()
    [0.0, 0.0, 2.0]
    """
    estimate, truth = checked_pair(estimate_m, truth_m)
    if mode not in MODES:
        raise ValueError(f"unknown alignment {mode!r}; known: {', '.join(MODES)}")
    if mode == "none":
        return Alignment(np.eye(3), np.zeros(3))
    mean_e, mean_t = estimate.mean(axis=0), truth.mean(axis=0)
    e, t = estimate - mean_e, truth - mean_t
    spread = max(np.mean(np.sum(e * e, axis=1)), np.mean(np.sum(t * t, axis=1)))
    least = _RANK_TOLERANCE * spread if unique else -1.0
    rotation = (_best_rotation if mode == "se3" else _best_yaw)(e, t, least)
    return Alignment(rotation, mean_t - rotation @ mean_e)


def checked_pair(estimate: np.ndarray, truth: np.ndarray, width: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Return both as float arrays of one shape.

    Parameters
    ----------
    estimate, truth : array_like
        (n, width).
    width : int
        Number of columns.

    Returns
    -------
    tuple of ndarray
        (n, width) each.

    Raises
    ------
    ValueError
        For other shapes, no rows, or values that are not finite.
    """
    a, b = np.asarray(estimate, float), np.asarray(truth, float)
    if a.shape != b.shape or a.ndim != 2 or a.shape[1] != width:
        raise ValueError(f"estimate {a.shape} and truth {b.shape} must both be (n, {width})")
    if not len(a):
        raise ValueError("no rows to compare")
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise ValueError("not a number among the rows to compare")
    return a, b


def _best_rotation(e: np.ndarray, t: np.ndarray, least: float) -> np.ndarray:
    """Umeyama eqs. 38-40, by SciPy."""
    if not np.linalg.svd(t.T @ e / len(e), compute_uv=False)[1] > least:
        raise AlignmentError("the paths do not determine a rotation: one of them is a point or a straight line")
    if not (e.any() and t.any()):
        return np.eye(3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a line, where any of the best is sufficient
        return np.asarray(Rotation.align_vectors(t, e)[0].as_matrix())


def _best_yaw(e: np.ndarray, t: np.ndarray, least: float) -> np.ndarray:
    """Maximises trace(Rz(yaw)^T C): tan yaw = (C10 - C01) / (C00 + C11)."""
    covariance = t.T @ e / len(e)
    sine, cosine = covariance[1, 0] - covariance[0, 1], covariance[0, 0] + covariance[1, 1]
    if not np.hypot(sine, cosine) > least:
        raise AlignmentError("the paths do not determine a yaw: one of them has no horizontal extent")
    yaw = np.arctan2(sine, cosine)
    return np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])

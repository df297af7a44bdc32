"""Errors of an estimated path against the true one: absolute (ATE), relative over path length (RTE), velocity, drift.

All arrays are rows at the same times; put an estimator's own timestamps onto the truth with ``association`` first.

References
----------
- Sturm et al. 2012, "A benchmark for the evaluation of RGB-D SLAM systems", IROS: ATE and RPE.
- Geiger et al. 2012, "Are we ready for autonomous driving? The KITTI vision benchmark suite", CVPR: errors per path
  length.
"""

from dataclasses import dataclass

import numpy as np

from .. import so3
from .alignment import Alignment, align, checked_pair


@dataclass(frozen=True)
class AbsoluteError:
    """Position errors after alignment.

    Attributes
    ----------
    errors_m : ndarray
        (n,) m.
    alignment : Alignment
        The rotation and shift that were used.
    """

    errors_m: np.ndarray
    alignment: Alignment

    @property
    def rmse_m(self) -> float:
        """Root mean square of the errors, m."""
        return rms(self.errors_m)

    @property
    def mean_m(self) -> float:
        """Mean of the errors, m."""
        return float(np.mean(self.errors_m))


def rms(errors: np.ndarray) -> float:
    """Return the root mean square, sqrt(mean e^2), over all entries.

    Parameters
    ----------
    errors : ndarray
        Any shape and unit.

    Returns
    -------
    float
        In the unit of ``errors``.
    """
    return float(np.sqrt(np.mean(np.square(errors))))


def ate(estimate_m: np.ndarray, truth_m: np.ndarray, mode: str = "se3", unique: bool = True) -> AbsoluteError:
    """Compute the absolute trajectory error e_i = |R p_est_i + t - p_i|, with (R, t) of ``align``.

    Parameters
    ----------
    estimate_m, truth_m : ndarray
        (n, 3) m, in the same frame.
    mode : str
        ``se3``, ``yaw`` or ``none``.
    unique : bool
        False: any of the best alignments will do. The least errors of a point or a straight line are known all the
        same.

    Returns
    -------
    AbsoluteError
        Errors in m, and the alignment.

    Raises
    ------
    AlignmentError
        Where the alignment is not determined and ``unique``.
    ValueError
        For other shapes, no rows, or values that are not finite.
    """
    estimate, truth = checked_pair(estimate_m, truth_m)
    alignment = align(estimate, truth, mode, unique)
    return AbsoluteError(np.linalg.norm(alignment.apply(estimate) - truth, axis=1), alignment)


def path_length(position_m: np.ndarray) -> np.ndarray:
    """Return the length of the path up to each row.

    Parameters
    ----------
    position_m : ndarray
        (n, 3) m.

    Returns
    -------
    ndarray
        (n,) m, 0 at the first row.
    """
    steps = np.linalg.norm(np.diff(position_m, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def pairs_by_path(truth_m: np.ndarray, length_m: float = 1.0, every: int = 10) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of rows that are ``length_m`` apart along the path.

    Starts whose end would lie behind the last row are left out.

    Parameters
    ----------
    truth_m : ndarray
        (n, 3) m.
    length_m : float
        Length of path between the two rows, m.
    every : int
        A start every so many rows.

    Returns
    -------
    tuple of ndarray
        Row numbers (starts, ends), (k,) each; empty for a path that is too short.
    """
    travelled = path_length(truth_m)
    starts = np.arange(0, len(travelled), every)
    starts = starts[travelled[starts] + length_m <= travelled[-1]]
    return starts, np.searchsorted(travelled, travelled[starts] + length_m, side="left")


def rte_published(estimate_m: np.ndarray, truth_m: np.ndarray, length_m: float = 1.0, every: int = 10) -> float:
    """Compute the relative error as NanoBench published it: mean |(p_est_j - p_est_i) - (p_j - p_i)|, without rotation.

    A constant yaw error of the estimate counts here, unlike in ``rte``.

    Parameters
    ----------
    estimate_m, truth_m : ndarray
        (n, 3) m, in the same frame.
    length_m : float
        Length of path between the two rows, m.
    every : int
        A start every so many rows.

    Returns
    -------
    float
        m; nan where the path is shorter than ``length_m``.

    Raises
    ------
    ValueError
        For other shapes, no rows, or values that are not finite.
    """
    estimate, truth = checked_pair(estimate_m, truth_m)
    i, j = pairs_by_path(truth, length_m, every)
    if not len(i):
        return float("nan")
    return float(np.mean(np.linalg.norm((estimate[j] - estimate[i]) - (truth[j] - truth[i]), axis=1)))


def relative_errors(estimate_m: np.ndarray, estimate_q: np.ndarray, truth_m: np.ndarray, truth_q: np.ndarray,
                    starts: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute errors of the relative pose from rows ``starts`` to rows ``ends``.

    e_ij = |R_est_i^T (p_est_j - p_est_i) - R_i^T (p_j - p_i)|, each in the body frame of its start, so that neither
    world frame matters. The angle is that of (R_i^T R_j)^T (R_est_i^T R_est_j).

    Parameters
    ----------
    estimate_m, truth_m : ndarray
        (n, 3) m, in the same frame.
    estimate_q, truth_q : ndarray
        (n, 4) x, y, z, w, body to world.
    starts, ends : ndarray
        (k,) row numbers.

    Returns
    -------
    tuple of ndarray
        (k,) m and (k,) rad.

    Raises
    ------
    ValueError
        For other shapes, no rows, or values that are not finite.
    """
    estimate, truth = checked_pair(estimate_m, truth_m)
    qe, qt = checked_pair(estimate_q, truth_q, 4)
    moved_e = so3.rotate_inverse(qe[starts], estimate[ends] - estimate[starts])
    moved_t = so3.rotate_inverse(qt[starts], truth[ends] - truth[starts])
    turned_e = so3.multiply(so3.conjugate(qe[starts]), qe[ends])
    turned_t = so3.multiply(so3.conjugate(qt[starts]), qt[ends])
    return np.linalg.norm(moved_e - moved_t, axis=1), so3.geodesic_angle(turned_t, turned_e)


def rte(estimate_m: np.ndarray, estimate_q: np.ndarray, truth_m: np.ndarray, truth_q: np.ndarray,
        length_m: float = 1.0, every: int = 10) -> float:
    """Compute the relative error over a length of path in the start's frame: the mean of ``relative_errors``.

    A constant error of the attitude (mocap body frame against sensor frame) enters as angle times ``length_m``.

    Parameters
    ----------
    estimate_m, truth_m : ndarray
        (n, 3) m, in the same frame.
    estimate_q, truth_q : ndarray
        (n, 4) x, y, z, w, body to world.
    length_m : float
        Length of path between the two rows, m.
    every : int
        A start every so many rows.

    Returns
    -------
    float
        m; nan where the path is shorter than ``length_m``.

    Raises
    ------
    ValueError
        For other shapes, no rows, or values that are not finite.
    """
    i, j = pairs_by_path(np.asarray(truth_m, float), length_m, every)
    if not len(i):
        return float("nan")
    return float(np.mean(relative_errors(estimate_m, estimate_q, truth_m, truth_q, i, j)[0]))


def velocity_rmse(estimate_m_s: np.ndarray, truth_m_s: np.ndarray) -> float:
    """Compute sqrt(mean |v_est - v|^2) over the 3-vector, not per axis.

    Parameters
    ----------
    estimate_m_s, truth_m_s : ndarray
        (n, 3) m/s, in the same frame.

    Returns
    -------
    float
        m/s.

    Raises
    ------
    ValueError
        For other shapes, no rows, or values that are not finite.
    """
    estimate, truth = checked_pair(estimate_m_s, truth_m_s)
    return rms(np.linalg.norm(estimate - truth, axis=1))


def drift_percent(estimate_m: np.ndarray, truth_m: np.ndarray) -> float:
    """Compute the end error per distance flown, 100 |(p_est_n - p_est_0) - (p_n - p_0)| / path length.

    Parameters
    ----------
    estimate_m, truth_m : ndarray
        (n, 3) m, in the same frame.

    Returns
    -------
    float
        %; nan where the truth does not move.

    Raises
    ------
    ValueError
        For other shapes, no rows, or values that are not finite.
    """
    estimate, truth = checked_pair(estimate_m, truth_m)
    length = path_length(truth)[-1]
    error = np.linalg.norm((estimate[-1] - estimate[0]) - (truth[-1] - truth[0]))
    return float(100.0 * error / length) if length > 0.0 else float("nan")


def drift_apart_percent(estimate_m: np.ndarray, truth_m: np.ndarray) -> tuple[float, float]:
    """Compute the horizontal and the vertical part of ``drift_percent``, each per length of the whole path.

    Parameters
    ----------
    estimate_m, truth_m : ndarray
        (n, 3) m, in the same frame.

    Returns
    -------
    tuple of float
        Horizontal and vertical, %; nan where the truth does not move.

    Raises
    ------
    ValueError
        For other shapes, no rows, or values that are not finite.
    """
    estimate, truth = checked_pair(estimate_m, truth_m)
    length = path_length(truth)[-1]
    if not length > 0.0:
        return float("nan"), float("nan")
    error = (estimate[-1] - estimate[0]) - (truth[-1] - truth[0])
    return float(100.0 * np.hypot(error[0], error[1]) / length), float(100.0 * abs(error[2]) / length)

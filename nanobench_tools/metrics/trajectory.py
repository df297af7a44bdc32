"""Errors of an estimated path against the true one: absolute (ATE), relative over path length (RTE), velocity, drift.

All arrays are rows at the same times; put an estimator's own timestamps onto the truth with ``association`` first.
Sources: Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems" (2012) for ATE and RPE;
Geiger et al., KITTI (2012) for errors per path length.
"""

from dataclasses import dataclass

import numpy as np

from .. import so3
from .alignment import Alignment, align, checked_pair


@dataclass(frozen=True)
class AbsoluteError:
    """Position errors after alignment: errors_m (n,) m, their RMS and mean, and the alignment used."""

    errors_m: np.ndarray
    alignment: Alignment

    @property
    def rmse_m(self) -> float:
        return rms(self.errors_m)

    @property
    def mean_m(self) -> float:
        return float(np.mean(self.errors_m))


def rms(errors: np.ndarray) -> float:
    """sqrt(mean e^2) over all entries; unit of ``errors``."""
    return float(np.sqrt(np.mean(np.square(errors))))


def ate(estimate_m: np.ndarray, truth_m: np.ndarray, mode: str = "se3", unique: bool = True) -> AbsoluteError:
    """Absolute trajectory error e_i = |R p_est_i + t - p_i| with (R, t) = ``align(..., mode, unique)``.

    estimate_m, truth_m (n, 3) m. Raises AlignmentError if the alignment is not determined, unless ``unique`` is False.
    The least errors of a point or a straight line are known all the same.
    """
    estimate, truth = checked_pair(estimate_m, truth_m)
    alignment = align(estimate, truth, mode, unique)
    return AbsoluteError(np.linalg.norm(alignment.apply(estimate) - truth, axis=1), alignment)


def path_length(position_m: np.ndarray) -> np.ndarray:
    """(n, 3) m -> (n,) m: length of the path up to each row, 0 at the first."""
    steps = np.linalg.norm(np.diff(position_m, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def pairs_by_path(truth_m: np.ndarray, length_m: float = 1.0, every: int = 10) -> tuple[np.ndarray, np.ndarray]:
    """Row numbers (starts, ends): a start every ``every`` rows, its end the first row ``length_m`` further along.

    Starts whose end would lie behind the last row are left out; both are empty for a path that is too short.
    """
    travelled = path_length(truth_m)
    starts = np.arange(0, len(travelled), every)
    starts = starts[travelled[starts] + length_m <= travelled[-1]]
    return starts, np.searchsorted(travelled, travelled[starts] + length_m, side="left")


def rte_published(estimate_m: np.ndarray, truth_m: np.ndarray, length_m: float = 1.0, every: int = 10) -> float:
    """Relative error as NanoBench published it [m]: mean |(p_est_j - p_est_i) - (p_j - p_i)|, no rotation.

    estimate_m, truth_m (n, 3) m. A constant yaw error of the estimate counts here, unlike in ``rte``. Returns nan when
    the path is shorter than ``length_m``.
    """
    estimate, truth = checked_pair(estimate_m, truth_m)
    i, j = pairs_by_path(truth, length_m, every)
    if not len(i):
        return float("nan")
    return float(np.mean(np.linalg.norm((estimate[j] - estimate[i]) - (truth[j] - truth[i]), axis=1)))


def relative_errors(estimate_m: np.ndarray, estimate_q: np.ndarray, truth_m: np.ndarray, truth_q: np.ndarray,
                    starts: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Errors of the relative pose from rows ``starts`` to rows ``ends``: ((k,) m, (k,) rad).

    e_ij = |R_est_i^T (p_est_j - p_est_i) - R_i^T (p_j - p_i)|, each in the body frame of its start, so that neither
    world frame matters. The angle is that of (R_i^T R_j)^T (R_est_i^T R_est_j).

    Inputs: estimate_m, truth_m (n, 3) m; estimate_q, truth_q (n, 4) x, y, z, w body to world.
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
    """Relative error over ``length_m`` of path in the start's frame [m]: mean of ``relative_errors`` over the starts.

    A constant error of the attitude (mocap body frame against sensor frame) enters as angle times ``length_m``. Returns
    nan when the path is shorter than ``length_m``.
    """
    i, j = pairs_by_path(np.asarray(truth_m, float), length_m, every)
    if not len(i):
        return float("nan")
    return float(np.mean(relative_errors(estimate_m, estimate_q, truth_m, truth_q, i, j)[0]))


def velocity_rmse(estimate_m_s: np.ndarray, truth_m_s: np.ndarray) -> float:
    """sqrt(mean |v_est - v|^2) [m/s] over the 3-vector, not per axis; both (n, 3) m/s in the same frame."""
    estimate, truth = checked_pair(estimate_m_s, truth_m_s)
    return rms(np.linalg.norm(estimate - truth, axis=1))


def drift_percent(estimate_m: np.ndarray, truth_m: np.ndarray) -> float:
    """100 |(p_est_n - p_est_0) - (p_n - p_0)| / path length: the end error per distance flown [%].

    estimate_m, truth_m (n, 3) m. nan when the truth does not move.
    """
    estimate, truth = checked_pair(estimate_m, truth_m)
    length = path_length(truth)[-1]
    error = np.linalg.norm((estimate[-1] - estimate[0]) - (truth[-1] - truth[0]))
    return float(100.0 * error / length) if length > 0.0 else float("nan")


def drift_apart_percent(estimate_m: np.ndarray, truth_m: np.ndarray) -> tuple[float, float]:
    """The horizontal and the vertical part of ``drift_percent``, each per the length of the whole path [%]."""
    estimate, truth = checked_pair(estimate_m, truth_m)
    length = path_length(truth)[-1]
    if not length > 0.0:
        return float("nan"), float("nan")
    error = (estimate[-1] - estimate[0]) - (truth[-1] - truth[0])
    return float(100.0 * np.hypot(error[0], error[1]) / length), float(100.0 * abs(error[2]) / length)

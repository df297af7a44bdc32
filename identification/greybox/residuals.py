"""What a fit makes small: the errors of Task 1 at some horizons, each measured in its own usual size."""

import numpy as np

from nanobench_tools.physics.model import POSITION, QUATERNION, RATE, VELOCITY

HORIZONS = np.array([1, 2, 5, 10, 20, 30, 40, 50])
GROUPS = 4
"""position, velocity, attitude, rate: each an error of three components, robust by its norm."""


def _left_matrix(quaternion: np.ndarray) -> np.ndarray:
    """(..., 4) true attitude q -> (..., 3, 4): 2 vec(q^-1 p) as a linear map of p."""
    x, y, z, w = np.moveaxis(quaternion, -1, 0)
    return 2.0 * np.stack([np.stack([w, z, -y, -x], -1), np.stack([-z, w, x, -y], -1), np.stack([y, -x, w, -z], -1)],
                          -2)


def errors(states: np.ndarray, derivatives: np.ndarray | None, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Errors (n, K, 4, 3) and their derivatives (n, K, 4, 3, F).

    Given: states (K, 13, n), derivatives (K, F, 13, n), truth (n, K, 13).
    Errors: position m, velocity m/s, attitude rad (vector part of the error quaternion, twice), rate rad/s."""
    x = states.transpose(2, 0, 1)
    n, horizons = x.shape[:2]
    sign = np.sign(np.sum(x[..., QUATERNION] * truth[..., QUATERNION], axis=-1))[..., None]
    turn = _left_matrix(truth[..., QUATERNION]) * sign[..., None]
    found = np.empty((n, horizons, GROUPS, 3))
    for group, part in ((0, POSITION), (1, VELOCITY), (3, RATE)):
        found[:, :, group] = x[..., part] - truth[..., part]
    found[:, :, 2] = np.einsum("nkij,nkj->nki", turn, x[..., QUATERNION])
    if derivatives is None:
        return found, np.empty((n, horizons, GROUPS, 3, 0))
    s = derivatives.transpose(3, 0, 2, 1)
    slope = np.empty((*found.shape, s.shape[-1]))
    for group, part in ((0, POSITION), (1, VELOCITY), (3, RATE)):
        slope[:, :, group] = s[:, :, part]
    slope[:, :, 2] = turn @ s[:, :, QUATERNION]
    return found, slope


def robust(found: np.ndarray, scale: np.ndarray, weight: np.ndarray) -> tuple[float, np.ndarray]:
    """Soft-L1 of the norms: sum of weight (sqrt(1 + |e|^2 / scale^2) - 1). Also the weight (n, K, 4) of each squared
    error in the normal equations.

    Shapes: found (n, K, 4, 3), scale and weight (K, 4)."""
    root = np.sqrt(1.0 + np.sum(found**2, axis=-1) / scale**2)
    return float(np.sum(weight * (root - 1.0))), weight / (scale**2 * root)

"""How sure a smoother is: covariances of its states from the elimination of the linearised problem.

Eliminated in time, the states of one time depend on those of the next alone: R x_i + S x_(i+1) = d. From the last one
back, cov_i = R^-1 (I + S cov_(i+1) S^T) R^-T. Source: Kaess and Dellaert, "Covariance recovery from a square root
information matrix", RAS 2009, for a chain.
"""

from typing import Any

import numpy as np

from nanobench_tools import so3

from .state_path import State

LATE, LATER = 3, 4
"""Where the slow quantities hold how late timestamps are, and by how much the poses' attitude is later still."""


def covariance_of(net: Any, keys: list[list[int]], sizes: list[int]) -> np.ndarray:
    """(K, n, n) of the variables of each time together; ``net`` eliminated in time, ``keys`` [K][variables of a time]
    of ``sizes`` rows each (n in all)."""
    count, n = len(keys), sum(sizes)
    starts = np.concatenate(([0], np.cumsum(sizes)))
    place = {key: (i, int(starts[j]), size) for i, row in enumerate(keys)
             for j, (key, size) in enumerate(zip(row, sizes, strict=True))}
    upper, ahead = np.zeros((count, n, n)), np.zeros((count, n, n))
    for at in range(net.size()):
        one = net.at(at)
        every = one.keys()
        time, row, size = place[every[0]]
        upper[time, row : row + size, row : row + size] = one.R()
        side, column = np.asarray(one.S()), 0
        for key in every[1:]:
            when, first, wide = place[key]
            target = upper if when == time else ahead
            target[time, row : row + size, first : first + wide] = side[:, column : column + wide]
            column += wide
    inverse = np.linalg.inv(upper)
    found = np.empty((count, n, n))
    found[-1] = inverse[-1] @ inverse[-1].T
    for i in range(count - 2, -1, -1):
        back = inverse[i] @ ahead[i]
        found[i] = inverse[i] @ inverse[i].T + back @ found[i + 1] @ back.T
    return found


def given_out(covariance: np.ndarray, state: State, rate: np.ndarray) -> np.ndarray:
    """(K, 9, 9) of position and velocity (world) and attitude (body) of the reported tracked body.

    Input: that of pose, velocity, biases, slow quantities (K, n, n) in this order; rate (K, 3) of the body [rad/s]."""
    count, n = covariance.shape[:2]
    by = np.zeros((count, 9, n))
    slow = 15
    by[:, :3, 3:6] = state.rotation
    by[:, :3, slow + LATE] = state.velocity
    by[:, 3:6, 6:9] = np.eye(3)
    by[:, 6:9, :3] = np.swapaxes(so3.matrix(so3.exp(state.slow[:, :3])), 1, 2)
    by[:, 6:9, slow : slow + 3] = np.eye(3)
    by[:, 6:9, slow + LATE] = by[:, 6:9, slow + LATER] = rate
    return np.asarray(by @ covariance @ np.swapaxes(by, 1, 2))


def between(time_s: np.ndarray, covariance: np.ndarray, at_s: np.ndarray) -> np.ndarray:
    """(m, 9, 9) at times (m,), on straight lines between the states at ``time_s`` (K,)."""
    before = np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, len(time_s) - 2)
    share = ((at_s - time_s[before]) / np.diff(time_s)[before]).clip(0.0, 1.0)[:, None, None]
    return np.asarray(covariance[before] * (1.0 - share) + covariance[before + 1] * share)

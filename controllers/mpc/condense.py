"""From linearised stages to a dense quadratic program in the inputs alone (condensing).

Errors e_k of the states against the target obey e_k = r_k + dx_k, dx_{k+1} = A_k dx_k + B_k du_k + c_k. The cost is
1/2 sum e_k' Q e_k (k = 1..N-1) + 1/2 e_N' P e_N + 1/2 sum |u_k + du_k - target|^2_R.

The result is 1/2 z' H z + g' z in z = du / UNIT_N (Jerez, Kerrigan, Constantinides 2012,
doi:10.1016/j.automatica.2012.03.010, eliminated form).
"""

import numba as nb
import numpy as np

from nanobench_tools.slices import put_matrix

UNIT_N = 0.1
"""Thrusts [N] are counted in this."""


@nb.njit(cache=True, fastmath=True)
def condense(a: np.ndarray, b: np.ndarray, c: np.ndarray, start: np.ndarray, residual: np.ndarray, q: np.ndarray,
             p: np.ndarray, r: np.ndarray, offset: np.ndarray, h: np.ndarray, g: np.ndarray, turns: np.ndarray,
             fixed: np.ndarray) -> None:
    """Writes h (4 N, 4 N) and g (4 N). The attitude errors of stages 1.. are fixed (N, 3) + turns (N, 3, 4 N) z.

    - a (N, S, S), b (N, 4, S) transposed, c (N, S), start (S,) dx_0, residual (N + 1, S).
    - q (S,) diagonal, p (S, S), r (4, 4), offset (N, 4) input minus its target [N]."""
    n, s = c.shape
    wide = 4 * n
    free = start.copy()
    grown, gamma, weighted = np.zeros((s, wide)), np.zeros((s, wide)), np.zeros((s, wide))
    h[:] = 0.0
    g[:] = 0.0
    for k in range(n):
        used = 4 * k
        for i in range(s):
            for j in range(used):
                grown[i, j] = 0.0
            total = c[k, i]
            for m in range(s):
                value = a[k, i, m]
                if value != 0.0:
                    total += value * free[m]
                    for j in range(used):
                        grown[i, j] += value * gamma[m, j]
            for j in range(4):
                grown[i, used + j] = UNIT_N * b[k, j, i]
            weighted[i, 0] = total  # borrowed: the free motion one step later
        for i in range(s):
            free[i] = weighted[i, 0]
        gamma, grown = grown, gamma
        used += 4
        for i in range(3):
            fixed[k, i] = residual[k + 1, 6 + i] + free[6 + i]
            for j in range(used):
                turns[k, i, j] = gamma[6 + i, j]
        for i in range(s):
            if k < n - 1:
                for j in range(used):
                    weighted[i, j] = q[i] * gamma[i, j]
            else:
                for j in range(used):
                    weighted[i, j] = 0.0
                for m in range(s):
                    value = p[i, m]
                    if value != 0.0:
                        for j in range(used):
                            weighted[i, j] += value * gamma[m, j]
        for i in range(s):
            if k < n - 1 and q[i] == 0.0:
                continue
            away = residual[k + 1, i] + free[i]
            for j in range(used):
                g[j] += weighted[i, j] * away
                value = gamma[i, j]
                if value != 0.0:
                    for m in range(j + 1):
                        h[j, m] += value * weighted[i, m]
    for k in range(n):
        for i in range(4):
            for j in range(4):
                h[4 * k + i, 4 * k + j] += UNIT_N * UNIT_N * r[i, j]
                g[4 * k + i] += UNIT_N * r[i, j] * offset[k, j]
    for j in range(wide):
        for m in range(j):
            h[m, j] = h[j, m]


@nb.njit(cache=True)
def condensed(a: np.ndarray, b: np.ndarray, c: np.ndarray, start: np.ndarray, residual: np.ndarray, q: np.ndarray,
              p: np.ndarray, yaw: float, turned: np.ndarray, r: np.ndarray, goals: np.ndarray, about: np.ndarray,
              least: np.ndarray, most: np.ndarray, h: np.ndarray, g: np.ndarray, turns: np.ndarray, fixed: np.ndarray,
              bounds: np.ndarray) -> None:
    """The program about inputs ``about`` (N, 4) N whose targets are ``goals`` (>= N, 4).

    The vehicle looks along ``yaw``. As ``condense``, with motors between least and most (4,) N as bounds (2, 4 N) of z.
    ``turned`` (S, S) takes the terminal weight."""
    n = about.shape[0]
    headed(p, yaw, turned)
    offset = about - goals[:n]
    for k in range(n):
        for i in range(4):
            bounds[0, 4 * k + i] = (least[i] - about[k, i]) / UNIT_N
            bounds[1, 4 * k + i] = (most[i] - about[k, i]) / UNIT_N
    condense(a, b, c, start, residual, q, turned, r, offset, h, g, turns, fixed)


@nb.njit(cache=True)
def headed(p: np.ndarray, yaw: float, out: np.ndarray) -> None:
    """Turns p (S, S), the terminal weight of a vehicle that looks along x, into that of one that looks along ``yaw``.
    Position and velocity are in the world, everything else in the body."""
    c, s = np.cos(yaw), np.sin(yaw)
    put_matrix(out, p)
    for first in (0, 3):
        for m in range(out.shape[1]):
            x, y = out[first, m], out[first + 1, m]
            out[first, m], out[first + 1, m] = c * x - s * y, s * x + c * y
    for first in (0, 3):
        for m in range(out.shape[0]):
            x, y = out[m, first], out[m, first + 1]
            out[m, first], out[m, first + 1] = c * x - s * y, s * x + c * y

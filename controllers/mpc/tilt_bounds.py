"""Bounds on where the thrust of a plan points: half-planes, added to a program where its answer tips too far.

The level part of the body's z axis of every stage is to stay within a circle of radius sin(most). A stage of an answer
outside the circle gets the tangent half-plane at the side on which it left. This is an outer approximation (Kelley
1960, doi:10.1137/0108053), linear in the error of the attitude. The program is solved again with it, at most ROUNDS
times. The half-planes are soft: a vehicle that is tipped too far already has no answer within them.
"""

import numba as nb
import numpy as np

ROUNDS = 3
SLACK = 2e-3
"""Of the sine: what may be left over."""
FARTHEST = 0.7
"""Sine of half the angle: a model linear in turns is not valid for larger ones."""
MOST_RAD = 0.75
"""In addition to errors, targets tilt by ``horizon.MOST_TILT_RAD`` at most."""
MARGIN_RAD = 0.15
"""What corrections may take beyond the tilt that targets ask for."""


@nb.njit(cache=True)
def halfplanes(targets: np.ndarray, turns: np.ndarray, radius: float, normal: np.ndarray, bound: np.ndarray) -> int:
    """Half-planes at stages that left the circle: normal (N, 3) and bound (N) of normal . turn <= bound; and their
    number.

    Inputs: targets (N + 1, 17), turns (N, 3) errors of the attitude against targets 1.., radius the sine of the most
    tilt. Values of other stages stay."""
    count = 0
    for k in range(turns.shape[0]):
        x, y, z = 0.5 * turns[k, 0], 0.5 * turns[k, 1], 0.5 * turns[k, 2]
        far = x * x + y * y + z * z
        if far > FARTHEST**2:
            continue
        w = np.sqrt(1.0 - far)
        axis = np.array([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)])
        i, j, m, r = targets[k + 1, 6], targets[k + 1, 7], targets[k + 1, 8], targets[k + 1, 9]
        level = np.array([[1.0 - 2.0 * (j * j + m * m), 2.0 * (i * j - r * m), 2.0 * (i * m + r * j)],
                          [2.0 * (i * j + r * m), 1.0 - 2.0 * (i * i + m * m), 2.0 * (j * m - r * i)]])
        a, b = 0.0, 0.0
        for c in range(3):
            a += level[0, c] * axis[c]
            b += level[1, c] * axis[c]
        size = np.sqrt(a * a + b * b)
        if size <= radius + SLACK:
            continue
        slope = np.array([[z - y * x / w, w - y * y / w, x - y * z / w],
                          [x * x / w - w, z + x * y / w, y + x * z / w], [-2.0 * x, -2.0 * y, 0.0]])
        bound[k] = radius - size
        for c in range(3):
            total = 0.0
            for e in range(3):
                total += (a * level[0, e] + b * level[1, e]) / size * slope[e, c]
            normal[k, c] = total
            bound[k] += total * turns[k, c]
        count += 1
    return count


@nb.njit(cache=True)
def turned(turns: np.ndarray, fixed: np.ndarray, z: np.ndarray, out: np.ndarray) -> None:
    """Errors of the attitude (N, 3) of an answer z: fixed (N, 3) + turns (N, 3, 4 N) z, into out."""
    for k in range(out.shape[0]):
        for c in range(3):
            total = fixed[k, c]
            for j in range(4 * (k + 1)):
                total += turns[k, c, j] * z[j]
            out[k, c] = total


@nb.njit(cache=True)
def left(turns: np.ndarray, fixed: np.ndarray, z: np.ndarray, targets: np.ndarray, stages: int, radius: float,
         out: np.ndarray, normal: np.ndarray, bound: np.ndarray) -> int:
    """``turned``, then ``halfplanes`` of the first ``stages``."""
    turned(turns, fixed, z, out)
    return halfplanes(targets, out[:stages], radius, normal, bound)


@nb.njit(cache=True)
def rows_of(turns: np.ndarray, fixed: np.ndarray, normal: np.ndarray, bound: np.ndarray, rows: np.ndarray,
            most: np.ndarray) -> int:
    """Half-planes whose bound is a number as rows . z <= most of the condensed program; how many there are."""
    count = 0
    for k in range(bound.shape[0]):
        if np.isnan(bound[k]):
            continue
        rows[count] = 0.0
        most[count] = bound[k]
        for c in range(3):
            most[count] -= normal[k, c] * fixed[k, c]
            for j in range(4 * (k + 1)):
                rows[count, j] += normal[k, c] * turns[k, c, j]
        count += 1
    return count

"""The reference over a controller's horizon: its known future, or an extrapolation of the present."""

from collections.abc import Callable
from dataclasses import dataclass

import numba as nb
import numpy as np

from nanobench_tools.firmware.guard import LARGEST
from nanobench_tools.methods import Reference
from nanobench_tools.settings import number

Future = Callable[[np.ndarray], Reference]
"""As ``Reference.ahead``."""
WIDTH = 14
"""position, velocity, acceleration, jerk (3 each), yaw, yaw rate."""
JUMP_M = 0.15
"""Minimum step between two points of a horizon, in excess of their velocity, that is a jump. Vehicles cannot fly it,
and it is answered only when it has come."""
LEAST_TILT_RAD, MOST_TILT_RAD = 0.1, 0.6
NEAR_M = number("control.horizon.near_m")
MOST_SINK_M_S2 = 4.0
"""A reference that asks to fall faster is answered by this."""


@dataclass(frozen=True)
class Gains:
    """World acceleration (3,) that a metre [1/s^2] and a metre per second [1/s] are answered by about hover."""

    position_1_s2: np.ndarray
    velocity_1_s: np.ndarray


class Horizon:
    """References at ``seconds`` (k,) from now, for n vehicles."""

    def __init__(self, seconds: np.ndarray) -> None:
        self.seconds = np.asarray(seconds, float)
        self._out, self._parts, self._good = np.empty((0, 0, WIDTH)), [np.empty(0)], np.empty(0, bool)

    def rows(self, reference: Reference, ahead: Future | None, landing: np.ndarray) -> tuple[np.ndarray, int]:
        """(n, k, WIDTH), valid until the next call, and the number of vehicles for which ``ahead`` was unusable and was
        extrapolated.

        ``reference`` is finite and whole (``Guard.admit``). ``ahead`` may return non-finite values; its exceptions pass
        through. Vehicles that are ``landing`` (n,) ignore it.
        """
        if ahead is None:
            return self._guessed(reference), 0
        given = self._given(ahead, len(landing))
        bad = _unsound(given, self._good)
        if bad == 0 and not landing.any():
            return given, 0
        found, good = self._guessed(reference), self._good & ~landing
        found[good] = given[good]
        return found, bad

    def _given(self, future: Future, n: int) -> np.ndarray:
        if len(self._out) != n:
            out = self._out = np.empty((n, len(self.seconds), WIDTH))
            self._parts = [out[:, :, a:a + 3].swapaxes(0, 1) for a in (0, 3, 6, 9)] + [out[:, :, 12].T, out[:, :, 13].T]
            self._good = np.empty(n, bool)
        ahead = future(self.seconds)
        found = (ahead.position_m, ahead.velocity_m_s, ahead.acceleration_m_s2, ahead.jerk_m_s3, ahead.yaw_rad,
                 ahead.yaw_rate_rad_s)
        for whole, part in zip(self._parts, found, strict=True):
            if part is not None and np.ndim(part) != whole.ndim:
                raise ValueError(f"Reference.ahead gave {np.shape(part)} where {whole.shape} was requested; give the "
                                 "future of the reference, not its present")
            whole[...] = 0.0 if part is None else part
        return self._out

    def _guessed(self, reference: Reference) -> np.ndarray:
        """Constant jerk for as long as that is not far: position by its Taylor series."""
        t = self.seconds[:, None]
        p, v, a, j = (np.asarray(x, float)[:, None] for x in (
            reference.position_m, reference.velocity_m_s, reference.acceleration_m_s2, reference.jerk_m_s3))
        out = np.empty((len(p), len(t), WIDTH))
        out[:, :, 0:3] = p + t * (v + t * (a / 2.0 + t * j / 6.0))
        out[:, :, 3:6] = v + t * (a + t * j / 2.0)
        out[:, :, 6:9] = a + t * j
        out[:, :, 9:12] = j
        turn = np.asarray(reference.yaw_rate_rad_s, float)[:, None]
        out[:, :, 12] = np.asarray(reference.yaw_rad, float)[:, None] + turn * self.seconds
        out[:, :, 13] = turn
        return out


@nb.njit(cache=True)
def _unsound(rows: np.ndarray, good: np.ndarray) -> int:
    """Whether all of a vehicle's rows (n, k, WIDTH) are below LARGEST, into good (n,); how many are not."""
    bad = 0
    for i in range(rows.shape[0]):
        good[i] = True
        for k in range(rows.shape[1]):
            for value in rows[i, k]:
                good[i] &= abs(value) < LARGEST  # nan is not less either
        bad += not good[i]
    return bad


@nb.njit(cache=True)
def without_jumps(rows: np.ndarray, seconds: np.ndarray) -> None:
    """rows (n, k, WIDTH) at ``seconds`` (k,), those behind a jump moved back to where the path would have gone on, in
    place."""
    gap, back = np.empty(3), np.empty(3)
    for i in range(rows.shape[0]):
        back[:] = 0.0
        before = rows[i, 0, :3].copy()
        for k in range(1, rows.shape[1]):
            here = rows[i, k, :3].copy()
            gap = here - before - 0.5 * (seconds[k] - seconds[k - 1]) * (rows[i, k, 3:6] + rows[i, k - 1, 3:6])
            if np.sum(gap * gap) > JUMP_M**2:
                back += gap
            for j in range(3):
                rows[i, k, j] -= back[j]
            before = here


@nb.njit(cache=True)
def most_tilt(lift_ratio: np.ndarray) -> np.ndarray:
    """Tilt [rad] (n,) at which a vehicle still carries its weight, lift_ratio (n,) being what carries over weight."""
    tilt = np.arccos(np.minimum(1.0 / np.maximum(lift_ratio, 1.0), 1.0))
    within: np.ndarray = np.minimum(np.maximum(tilt, LEAST_TILT_RAD), MOST_TILT_RAD)
    return within


@nb.njit(cache=True)
def flyable(rows: np.ndarray, seconds: np.ndarray, x: np.ndarray, gains: np.ndarray, most_N: np.ndarray,
            hover_N: float, gravity: float, pushed_m_s2: np.ndarray, tilt_rad: float, near_m: float) -> None:
    """Both of the following, from the available motor thrust most_N (n, 4) and hover_N, a motor's share of the weight.
    Targets tip no further than tilt_rad. gains (2, 3): ``Gains``."""
    n = rows.shape[0]
    lift, level = np.empty(n), np.empty(n)
    for i in range(n):
        total = ((most_N[i, 0] + most_N[i, 1]) + most_N[i, 2]) + most_N[i, 3]
        lift[i] = total / (4.0 * hover_N) * gravity + pushed_m_s2[i, 2]  # m/s^2, all that carries
    tilt = most_tilt(lift / gravity)
    for i in range(n):
        level[i] = gravity * np.tan(min(tilt[i], tilt_rad))
    without_jumps(rows, seconds)
    within_reach(rows, x, gains[0], gains[1], level, lift - gravity, pushed_m_s2, near_m)


@nb.njit(cache=True)
def within_reach(rows: np.ndarray, x: np.ndarray, position_1_s2: np.ndarray, velocity_1_s: np.ndarray,
                 level_m_s2: np.ndarray, up_m_s2: np.ndarray, pushed_m_s2: np.ndarray, near_m: float) -> None:
    """Limit rows (n, k, WIDTH) to a horizontal acceleration of level_m_s2 (n,) and an upward one of up_m_s2 (n,). Both
    are in addition to the disturbance pushed_m_s2 (n, >= 3).

    Accelerations along the path are cut. All points of a vehicle are moved so that ``Gains`` need no more than that
    for its lag x (n, 17). Height is given up first, because motors must stay free to turn the vehicle. A vehicle with
    little spare lift loses height when it tips after a reference that has jumped. Within near_m all points stay, since
    the program knows its bounds and looks further ahead than these gains. The limit fades in up to twice that
    distance. A vehicle that cannot carry its weight gets a sinking target wherever it is.
    """
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            row = rows[i, k]
            size, fast = np.sqrt(row[6] * row[6] + row[7] * row[7]), False
            if size > level_m_s2[i]:
                row[6], row[7], fast = row[6] * level_m_s2[i] / size, row[7] * level_m_s2[i] / size, True
            if row[8] > max(up_m_s2[i], 0.0) or row[8] < -MOST_SINK_M_S2:
                row[8], fast = min(max(row[8], -MOST_SINK_M_S2), max(up_m_s2[i], 0.0)), True
            if fast:  # nothing is known of the jerk then
                row[9:12] = 0.0
        first = rows[i, 0]
        ask = np.empty(3)
        for j in range(3):
            ask[j] = (first[6 + j] + position_1_s2[j] * (first[j] - x[i, j])
                      + velocity_1_s[j] * (first[3 + j] - x[i, 3 + j]) - pushed_m_s2[i, j])
        size = np.sqrt(ask[0] * ask[0] + ask[1] * ask[1])
        gap = first[:3] - x[i, :3]
        share = 1.0
        if near_m > 0.0 and up_m_s2[i] > 0.0:
            share = min(max(np.sqrt(np.sum(gap * gap)) / near_m - 1.0, 0.0), 1.0)
        over = share * (1.0 - level_m_s2[i] / size) if size > level_m_s2[i] else 0.0
        high = share * (ask[2] - min(max(ask[2], -MOST_SINK_M_S2), up_m_s2[i]))
        for k in range(rows.shape[1]):
            rows[i, k, 0] -= over / position_1_s2[0] * ask[0]
            rows[i, k, 1] -= over / position_1_s2[1] * ask[1]
            rows[i, k, 2] -= high / position_1_s2[2]

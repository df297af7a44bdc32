"""The reference over a controller's horizon: what is known of the future, else what now says about it."""

from __future__ import annotations

import numpy as np

from nanobench_tools.guard import LARGEST
from nanobench_tools.methods import Reference

WIDTH = 14
"""position, velocity, acceleration, jerk (3 each), yaw, yaw rate."""
JUMP_M = 0.6
"""A reference further away than this is answered as if it were so far, all of its horizon moved along."""


class Horizon:
    """References at ``seconds`` (k,) from now, for n vehicles."""

    def __init__(self, seconds: np.ndarray) -> None:
        self.seconds = np.asarray(seconds, float)

    def rows(self, reference: Reference, landing: np.ndarray) -> tuple[np.ndarray, int]:
        """(n, k, WIDTH), and of how many vehicles ``ahead`` was no use, so that it was guessed.

        ``reference`` is finite and whole (``Guard.admit``), its ``ahead`` need not be; vehicles that are ``landing``
        (n,) do not look at it.
        """
        found = self._guessed(reference)
        if reference.ahead is None:
            return found, 0
        told = self._told(reference, len(found))
        good = np.isfinite(told).all(axis=(1, 2)) & (np.abs(told[:, :, :3]) < LARGEST).all(axis=(1, 2))
        bad = int(np.count_nonzero(~good))
        good &= ~landing
        if good.all():
            return told, 0
        found[good] = told[good]
        return found, bad

    def _told(self, reference: Reference, n: int) -> np.ndarray:
        out = np.full((n, len(self.seconds), WIDTH), np.nan)
        try:
            ahead = reference.ahead(self.seconds)  # type: ignore[misc]
            parts = (ahead.position_m, ahead.velocity_m_s, ahead.acceleration_m_s2, ahead.jerk_m_s3, ahead.yaw_rad,
                     ahead.yaw_rate_rad_s)
            for i, part in enumerate(parts):
                if i < 4:
                    out[:, :, 3 * i:3 * i + 3] = 0.0 if part is None else np.moveaxis(np.asarray(part), 0, 1)
                else:
                    out[:, :, 8 + i] = 0.0 if part is None else np.asarray(part).T
        except Exception:  # the future is anybody's code; the present has been checked
            out[:] = np.nan
        return out

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


def within_reach(rows: np.ndarray, position_m: np.ndarray) -> np.ndarray:
    """rows (n, k, WIDTH), moved so that their first is at most JUMP_M from position (n, 3)."""
    away = rows[:, 0, :3] - position_m
    far = np.linalg.norm(away, axis=1, keepdims=True)
    if (far > JUMP_M).any():
        rows = rows.copy()
        rows[:, :, :3] -= (away * np.maximum(1.0 - JUMP_M / np.maximum(far, 1e-9), 0.0))[:, None]
    return rows

"""Features of class ``past``: how wrong the model was over the last two seconds, and what would have put it right.

The model is flown over pieces of the past, the last of which end at the start of the window. Their errors at the end,
and the nuisances that explain them best, show how this vehicle differs at present. The nuisances are a maximum a
posteriori estimate, to first order, over the last 0.2 to 2 s. Nothing later than the start is looked at.
"""

from dataclasses import dataclass
from typing import cast

import numpy as np

from nanobench_tools import so3
from nanobench_tools.methods import Past, Windows
from nanobench_tools.physics import Model
from nanobench_tools.settings import count, number, setting

from .residuals import HORIZONS, errors, robust
from .sensitivity import sensitivities
from .solve import Nuisance
from .symmetry import Features

STEP = count("greybox.observer.step")
PIECES = count("greybox.observer.pieces")
WARM = count("greybox.observer.warm")
MEMORIES = setting("greybox.observer.memories")
SHARE = number("greybox.observer.share")
LAST = setting("greybox.observer.last")
GYRO_ROWS = setting("greybox.observer.gyro_rows")
CHUNK = 1024


@dataclass(frozen=True)
class Observer:
    """A model with ``frame_tilt`` and ``thrust_scale`` in it, and the scale (K, 4) of its errors. The values that may
    differ are thrust, three trims and two tilts."""

    model: Model
    nuisances: tuple[Nuisance, ...]
    scale: np.ndarray

    def features(self, windows: Windows, found: Features) -> None:
        """Adds to ``found``; zero where the flight had not begun."""
        past, n = windows.past, len(windows)
        assert past is not None
        states = np.concatenate([past.position_m, past.velocity_m_s, past.quaternion, past.rate_rad_s], axis=2)
        start = np.concatenate([windows.position_m, windows.velocity_m_s, windows.quaternion, windows.rate_rad_s], 1)
        states = np.concatenate([states, start[:, None]], axis=1)
        last = states.shape[1] - 1
        pieces = np.arange(1, PIECES + 1)
        begin = last - STEP * pieces
        usable = (STEP * pieces[:, None] >= HORIZONS) & (past.rows[:, None, None] >= STEP * pieces[:, None])
        # neighbouring windows share pieces: each is flown once, as the window sees it that knows most of it
        longest = np.arange(n * PIECES).reshape(n, PIECES)[:, ::-1].T.ravel()
        window, piece = np.divmod(longest, PIECES)
        flown = past.rows[window] >= STEP * (piece + 1)
        order = np.concatenate([longest[flown], longest[~flown]])
        window, piece = np.divmod(order, PIECES)
        _, first, shared = np.unique(states[window, begin[piece]], axis=0, return_index=True, return_inverse=True)
        hessian, gradient, wrong = self._flown(windows, states, window[first], piece[first])
        place = np.empty(n * PIECES, int)
        place[order] = shared.ravel()
        seen = usable.reshape(n * PIECES, -1)
        hessian, gradient, wrong = (x[place] * seen.reshape(*seen.shape, *[1] * (x.ndim - 2))
                                    for x in (hessian, gradient, wrong))
        hessian = hessian.reshape(n, PIECES, *hessian.shape[1:])
        gradient, wrong = gradient.reshape(n, PIECES, *gradient.shape[1:]), wrong.reshape(n, PIECES, *wrong.shape[1:])
        for memory in MEMORIES:
            explained = self._explained(hessian, gradient, *memory)
            found.level(explained[:, 0])
            found.turn(explained[:, 1:4])
            found.lean(explained[:, 4:])
        self._last(windows, wrong, found)

    def _flown(self, windows: Windows, states: np.ndarray, window: np.ndarray,
               piece: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Curvature (m, K, N, N) and slope (m, K, N) of the cost by nuisances, and errors (m, K, 4, 3). For pieces
        (window, piece), each (m,). Horizons beyond the start of the window are meaningless."""
        past, last, count = cast("Past", windows.past), states.shape[1] - 1, len(self.nuisances)
        begin = last - STEP * np.arange(1, PIECES + 1)
        ahead = np.minimum(begin[:, None] + np.arange(HORIZONS[-1]), last - 1)
        before = begin[:, None] + np.arange(-WARM, 0)
        came = np.minimum(begin[:, None] + HORIZONS, last)
        weight = np.full(self.scale.shape, 1.0 / self.scale.size)
        patterns = np.array([nuisance.vector(self.model) for nuisance in self.nuisances]).T
        parts = []
        for low in range(0, len(window), CHUNK):
            w, p = window[low:low + CHUNK], piece[low:low + CHUNK]
            rows = w[:, None]
            x, s = sensitivities(self.model, states[w, begin[p]], past.motor[rows, ahead[p]],
                                 past.battery_V[rows, ahead[p]],
                                 (past.motor[rows, before[p]], past.battery_V[rows, before[p]]), patterns,
                                 keep=HORIZONS, row_hz=windows.rate_hz)
            e, slope = errors(x, s, states[rows, came[p]])
            root = np.sqrt(robust(e, self.scale, weight)[1])[..., None]
            rooted = (slope * root[..., None]).reshape(*e.shape[:2], -1, count)
            parts.append((rooted.transpose(0, 1, 3, 2) @ rooted,
                          np.einsum("nkrA,nkr->nkA", rooted, (e * root).reshape(*e.shape[:2], -1)), e))
        hessian, gradient, wrong = (np.concatenate(part) for part in zip(*parts, strict=True))
        return hessian, gradient, wrong

    def _explained(self, hessian: np.ndarray, gradient: np.ndarray, pieces: int, longest: int) -> np.ndarray:
        """Nuisances (n, N) in units of their spread."""
        spread = np.array([nuisance.sd for nuisance in self.nuisances])
        within = longest >= HORIZONS
        matrix = SHARE * hessian[:, :pieces, within].sum(axis=(1, 2)) * np.outer(spread, spread) + np.eye(len(spread))
        slope = SHARE * gradient[:, :pieces, within].sum(axis=(1, 2)) * spread
        return -np.linalg.solve(matrix, slope[..., None])[..., 0]

    def _last(self, windows: Windows, wrong: np.ndarray, found: Features) -> None:
        """Errors of velocity (turned into the body), attitude and rate of the newest pieces, in their usual size."""
        for piece, horizons in LAST:
            for h in horizons:
                k = int(np.flatnonzero(h == HORIZONS)[0])
                e = wrong[:, piece - 1, k] / self.scale[k][:, None]
                found.move(so3.rotate_inverse(windows.quaternion, e[:, 1]))
                found.turn(e[:, 2])
                found.turn(e[:, 3])


def gyro_before(windows: Windows, found: Features) -> None:
    """Adds how the gyro rows before the start differ from the row of the start."""
    past = cast("Past", windows.past)
    for row in GYRO_ROWS:
        found.turn(past.rate_rad_s[:, -row] - windows.rate_rad_s)

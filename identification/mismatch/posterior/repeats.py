"""Does a force without a name repeat? What other flights show of it, taken from a flight that was left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from nanobench_tools.settings import number

from .background import SAMPLE_S
from .build import Case
from .sizing import Refined, nuisance, parts_of

REPEATING = ("place", "air", "thrust", "late")
"""Groups of the background that all flights share."""
WINDOW_S = 0.5
"""The path after half a second follows the mean force of that time."""
LEAST = number("posterior.repeats.least")
"""Of the error of the path, as for an effect that is called visible."""


@dataclass(frozen=True)
class Repeat:
    """The force that repeats.

    share: part of the slow force in flights left out that it explains, the median over flights. It is negative where
    the force adds. taken_m_s2: RMS of that part. group: of the background, the largest one. size_m_s2: RMS.
    """

    share: float
    taken_m_s2: float
    group: str
    size_m_s2: float

    def rises(self, path_error_m: float) -> float:
        """Share by which the error of the path after WINDOW_S is larger without this force than with it.
        ``path_error_m``: the error without it."""
        left = path_error_m**2 - (0.5 * WINDOW_S**2 * self.taken_m_s2) ** 2
        return path_error_m / float(np.sqrt(left)) - 1.0 if left > 0.0 else float("inf")

    def matters(self, path_error_m: float) -> bool:
        """Whether predictions without it are visibly worse."""
        return self.share > 0.0 and self.rises(path_error_m) >= LEAST


def repeat_of(case: Case, found: Refined) -> Repeat:
    """The force that repeats and that the effects of a set do not explain. With one flight it is none."""
    flights, background = case.flights, case.background
    if len(flights) < 2:
        return Repeat(0.0, 0.0, REPEATING[0], 0.0)
    force = case.wrench.residual(found.model)[0]
    for i, part in parts_of(case, found.chosen, found.step):
        if case.effects[i].map_share:
            force = force - case.effects[i].force @ part
    flight, track = (of[case.wrench.force_at] for of in (case.wrench.flight, case.wrench.track))
    slow, sizes = np.zeros((len(flights), 2)), np.zeros((len(flights), len(REPEATING)))
    for k, one in enumerate(flights):
        mine = flight == one
        coefficients = nuisance(case, found, flights != one)[case.evidence.P:]
        said = np.stack([background.force[mine][..., at] @ coefficients[at]
                         for at in (background.group == g for g in REPEATING)])
        slow[k] = [_slow(x, track[mine]) for x in (force[mine], force[mine] - said.sum(0))]
        sizes[k] = np.sqrt((said**2).sum(-1).mean(-1))
    rms = np.sqrt((sizes**2).mean(0))
    share = float(np.median(1.0 - slow[:, 1] / np.maximum(slow[:, 0], 1e-12)))
    taken = float(np.sqrt(max(float((slow[:, 0] ** 2 - slow[:, 1] ** 2).mean()), 0.0)))
    return Repeat(share, taken, REPEATING[int(np.argmax(rms))], float(np.sqrt((rms**2).sum())))


def _slow(force: np.ndarray, track: np.ndarray) -> float:
    """RMS of the mean over WINDOW_S of a force (n, 3), without its mean."""
    parts = [uniform_filter1d(force[track == one], int(WINDOW_S / SAMPLE_S), axis=0, mode="nearest")
             for one in np.unique(track)]
    slow = np.concatenate(parts)
    return float(np.sqrt(((slow - slow.mean(0)) ** 2).sum(1).mean()))

"""Choice of the best model of Task 1, on training flights alone, whole flights held out in turn.

No row of a test flight is used. A fitted model is fitted again without each group of training flights and scored on
that group. A model that is not fitted here is scored unchanged on the same flights.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..metrics.prediction import QUANTITIES
from ..results.result import Result
from .task1 import Case, WindowErrors

GROUPS = 4
"""Groups of training flights, each left out once; a fit of fifteen flights then still has eleven."""
FEWEST = 2
"""Training flights of which one can be held out."""


def held_out(cases: Sequence[Case], groups: int = GROUPS) -> list[tuple[list[Case], list[Case]]]:
    """(flights to fit, flights held out) of every group. With fewer than FEWEST flights it is one pair with the same
    flights in both, so none is held out."""
    if len(cases) < FEWEST:
        return [(list(cases), list(cases))]
    count = min(groups, len(cases))
    return [([case for i, case in enumerate(cases) if i % count != group], list(cases[group::count]))
            for group in range(count)]


def criterion(scores: Sequence[WindowErrors]) -> float | None:
    """Geometric mean of the four errors summed over 1..50 steps, in m, m/s, rad and rad/s to the power 1/4; ``scores``
    of whole flights as ``task1.score`` gives them. None without a window. The ranking does not depend on the units."""
    count = sum(score.windows for score in scores)
    if not count:
        return None
    sums = [sum(float(np.sum(score.sums[name])) for score in scores) / count for name in QUANTITIES]
    return float(np.exp(np.mean(np.log(np.maximum(sums, 1e-12)))))


def best_of(scores: Mapping[str, float | None]) -> str | None:
    """The model with the least criterion; None where no model has one."""
    known = {name: value for name, value in scores.items() if value is not None}
    return min(known, key=known.__getitem__) if known else None


@dataclass(frozen=True, repr=False)
class ChosenOn(Result):
    """On which flights the best model was chosen, held out in so many groups; the criterion of every model."""

    flights: Sequence[str]
    groups: int
    how: str
    criterion: Mapping[str, float | None]
    not_asked: Sequence[str]


def reported(cases: Sequence[Case], scores: Mapping[str, float | None], not_considered: Sequence[str] = ()) -> ChosenOn:
    """not_considered: models of class ``state`` that had no part, as they cannot be trained again for every group."""
    count = len(held_out(cases))
    how = (f"{len(cases)} training flights, held out whole in {count} groups; least geometric mean of the four summed "
           "errors, onboard truth" if len(cases) >= FEWEST else
           "the one training flight that also fitted them: nothing could be held out" if cases else
           "no training flight: nothing was chosen")
    return ChosenOn([case.flight.name for case in cases], count if len(cases) >= FEWEST else 0, how, scores,
                    not_considered)

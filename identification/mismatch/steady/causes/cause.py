"""Causes of a change: possible sizes, and the effect of each on the trim of a hovering vehicle."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import qmc

DRAWS = 4096
"""Of the sizes of a hypothesis, spread evenly over their ranges (Sobol): marginal likelihoods to 1 %."""
PLACES = {1: "front right", 2: "back right", 3: "back left", 4: "front left"}
"""Where the motors of a Crazyflie sit."""

Sizes = Mapping[str, tuple[float, float, float]]
"""Value, low and high end by the name of a size."""


@dataclass(frozen=True)
class Body:
    """Known properties of the vehicle: motors (4, 2) m, x forward and y left of each; mass_kg; height_m it flew at;
    ``swing``: a periodic force that the flights show, or None; ``absent``: causes that the user excludes."""

    motors: np.ndarray
    mass_kg: float
    height_m: float = float("nan")
    swing: Mapping[str, Any] | None = None
    absent: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Size:
    """One number of a hypothesis: its name, unit, and values (n,) of the draws in that unit."""

    name: str
    unit: str
    values: np.ndarray


@dataclass(frozen=True)
class Hypothesis:
    """One way a cause may act: at ``motors``, with sizes drawn from their ranges.

    ``gains`` (n, 4): change of the commanded ln thrust; ``push`` (n, 2): m/s^2 of horizontal force over mass.
    ``spread``: instead of draws, {quantity: sd} of Gaussian changes without further shape. ``share``: of the cause's
    prior. ``seen``: probability, under the hypothesis, of the swing in the flights.
    """

    cause: str
    motors: tuple[int, ...]
    share: float
    sizes: tuple[Size, ...] = ()
    gains: np.ndarray = field(default_factory=lambda: np.zeros((1, 4)))
    push: np.ndarray = field(default_factory=lambda: np.zeros((1, 2)))
    spread: Mapping[str, float] = field(default_factory=dict)
    seen: float = 1.0


@dataclass(frozen=True)
class Cause:
    """One possible cause of a change of the trim.

    ``name``: as in verdict.json. ``term``: of the vocabulary, models the cause; or None. ``prior``: probability, before
    any flight was seen, that this cause changed a vehicle. ``make``: (body) -> hypotheses. ``say``: (sizes, motors) ->
    the sentence's beginning, with sizes {name: (value, low, high)}. ``short``: a few words. ``special_of``: a cause of
    which it is a special case, and which is reported with it. For example, a weight in the very middle is another mass.
    """

    name: str
    term: str | None
    prior: float
    make: Callable[[Body], Sequence[Hypothesis]]
    say: Callable[[Sizes, Sequence[int]], str]
    short: str
    special_of: str | None = None


@functools.cache
def draws(k: int) -> np.ndarray:
    """(DRAWS, k) evenly spread over the unit cube, the same each time."""
    found: np.ndarray = qmc.Sobol(k, seed=11).random(DRAWS)
    found.setflags(write=False)
    return found


def interval(size: tuple[float, float, float], digits: int, unit: str) -> str:
    """``13 % (95 %: 8 to 18)``."""
    value, low, high = size
    return f"{value:.{digits}f} {unit} (95 %: {low:.{digits}f} to {high:.{digits}f})"


def motor_words(motors: Sequence[int]) -> str:
    """``motor 3 (back left)``, ``motors 1 (front right) and 2 (back right)``."""
    said = [f"{m} ({PLACES[m]})" for m in motors]
    if not said:
        return "a motor of which it is not sure which"
    return f"motor {said[0]}" if len(said) == 1 else f"motors {', '.join(said[:-1])} and {said[-1]}"

"""Another mass in the middle of the vehicle: all four motors have equally higher, or lower, commands."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nanobench_tools.settings import number

from .cause import Body, Cause, Hypothesis, Size, Sizes, draws, interval

MOST = number("mismatch.mass.most")


def alike(body: Body) -> tuple[tuple[Size, ...], np.ndarray]:
    """(change of the mass %) of draws, and the change of the ln thrust (n, 4)."""
    share = MOST * (2.0 * draws(1)[:, 0] - 1.0)
    return (Size("change", "%", 100.0 * share),), np.log1p(share)[:, None] * np.ones(4)


def make(body: Body) -> list[Hypothesis]:
    sizes, gains = alike(body)
    return [Hypothesis("mass", (), 1.0, sizes, gains)]


def say(sizes: Sizes, motors: Sequence[int]) -> str:
    return f"The vehicle weighs more, in its middle, by {interval(sizes['change'], 1, '%')}"


PRIOR = 0.025
"""Probability before anything is seen."""
CAUSE = Cause("mass", "mass", PRIOR, make, say, "another mass", special_of="weight")

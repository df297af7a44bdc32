"""A steady wind: the vehicle leans against it while its motors stay in balance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nanobench_tools.settings import number

from .cause import Body, Cause, Hypothesis, Size, Sizes, draws, interval

MOST_M_S2 = number("mismatch.wind.most_m_s2")


def make(body: Body) -> list[Hypothesis]:
    push = MOST_M_S2 * (2.0 * draws(2) - 1.0)
    sizes = (Size("push_forward", "m/s^2", push[:, 0]), Size("push_left", "m/s^2", push[:, 1]))
    return [Hypothesis("wind", (), 1.0, sizes, np.zeros((len(push), 4)), push)]


def say(sizes: Sizes, motors: Sequence[int]) -> str:
    text = " and ".join(f"{interval(size, 2, 'm/s^2')} {name[5:]}" for name, size in sizes.items())
    return f"Wind pushes the vehicle: force over mass of {text}"


PRIOR = 0.025
"""Probability before anything is seen."""
CAUSE = Cause("wind", "wind", PRIOR, make, say, "wind")

"""The battery's voltage changes the thrust in a way that the simulator omits: all four motors change alike.

From the trim alone it is indistinguishable from another mass; flights at other states of charge would distinguish them.
"""

from __future__ import annotations

from collections.abc import Sequence

from .cause import Body, Cause, Hypothesis, Sizes, interval
from .mass import alike


def make(body: Body) -> list[Hypothesis]:
    sizes, gains = alike(body)
    return [Hypothesis("battery", (), 1.0, sizes, gains)]


def say(sizes: Sizes, motors: Sequence[int]) -> str:
    return f"All four motors are commanded more alike, by {interval(sizes['change'], 1, '%')}: thrust depends on the " \
           "voltage otherwise than before"


PRIOR = 0.025
"""Probability before anything is seen."""
CAUSE = Cause("battery", "thrust_voltage", PRIOR, make, say, "thrust that follows the battery otherwise")

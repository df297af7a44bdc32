"""A load on a string: in the mean a weight at the place of the knot, and a pendulum that pulls to and fro.

Its mode is sqrt(g / L (1 + m / M)) / (2 pi). L is the length of the string, m the mass of the load, M that of the
vehicle. Without a swing in the flights it is a weight. If the string is longer than the flight is high, the load stays
on the ground, where it neither swings nor weighs in full.
"""

from __future__ import annotations

from collections.abc import Sequence

from nanobench_tools.settings import number

from .cause import Body, Cause, Hypothesis, Sizes, interval
from .weight import loads, where

UNSEEN = number("mismatch.slung.unseen")


def make(body: Body) -> list[Hypothesis]:
    sizes, gains = loads(body)
    return [Hypothesis("slung", (), 1.0, sizes, gains, seen=1.0 if body.swing is not None else UNSEEN)]


def say(sizes: Sizes, motors: Sequence[int]) -> str:
    near = f", nearest to motor {motors[0]}" if motors else ""
    swings = (f"; it swings at {interval(sizes['frequency'], 2, 'Hz')}, as on a string of "
              f"{interval(sizes['length'], 2, 'm')}") if "frequency" in sizes else ""
    return f"A load hangs on a string: {interval(sizes['mass'], 1, 'g')}, its knot {where(sizes)}{near}{swings}"


PRIOR = number("mismatch.slung.prior")
CAUSE = Cause("slung", "slung_load", PRIOR, make, say, "a load on a string")

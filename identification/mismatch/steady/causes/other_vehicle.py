"""Another vehicle: every motor has a different gain, and its thrust has a different angle to its sensors."""

from __future__ import annotations

from collections.abc import Sequence

from nanobench_tools.settings import number

from .cause import Body, Cause, Hypothesis, Sizes

GAINS = number("mismatch.other_vehicle.gains")
LEVEL_M_S2 = number("mismatch.other_vehicle.level_m_s2")


def make(body: Body) -> list[Hypothesis]:
    return [Hypothesis("vehicle", (), 1.0, spread={"gains": GAINS, "level": LEVEL_M_S2})]


def say(sizes: Sizes, motors: Sequence[int]) -> str:
    return "This is another vehicle: gains of the motors and the angle between thrust and sensors differ at once"


PRIOR = number("mismatch.other_vehicle.prior")
CAUSE = Cause("vehicle", None, PRIOR, make, say, "another vehicle")

"""An added weight at a place: mass and centre of mass change together, and the yaw balance does not.

A mass m at (x, y) needs a force m g at that place. Four motors give it without turning the vehicle about z by

    dT_i = m g / 4 (1 + x x_i / X^2 + y y_i / Y^2)

X^2 and Y^2 are the mean squares of the motors' positions x_i, y_i. So all three numbers follow from the four motors. A
moment without a weight is rejected.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nanobench_tools.settings import number

from .cause import Body, Cause, Hypothesis, Size, Sizes, draws, interval

MOST = number("mismatch.weight.most")
REACH = number("mismatch.weight.reach")


def loads(body: Body) -> tuple[tuple[Size, ...], np.ndarray]:
    """(mass g, x mm, y mm) of draws, and the change of the ln thrust (n, 4) that each requires."""
    u = draws(3)
    span = REACH * np.abs(body.motors).max(axis=0)
    share, place = MOST * u[:, 0], (2.0 * u[:, 1:] - 1.0) * span
    lever = body.motors / np.mean(body.motors**2, axis=0)  # (4, 2)
    more = share[:, None] * (1.0 + place @ lever.T)
    sizes = (Size("mass", "g", 1e3 * share * body.mass_kg), Size("x", "mm", 1e3 * place[:, 0]),
             Size("y", "mm", 1e3 * place[:, 1]))
    return sizes, np.log(np.maximum(1.0 + more, 0.05))


def make(body: Body) -> list[Hypothesis]:
    sizes, gains = loads(body)
    return [Hypothesis("weight", (), 1.0, sizes, gains)]


def where(sizes: Sizes) -> str:
    return f"{interval(sizes['x'], 0, 'mm')} forward and {interval(sizes['y'], 0, 'mm')} to the left of the middle"


def say(sizes: Sizes, motors: Sequence[int]) -> str:
    near = f", nearest to motor {motors[0]}" if motors else ""
    return f"A weight was added: {interval(sizes['mass'], 1, 'g')}, {where(sizes)}{near}"


PRIOR = number("mismatch.weight.prior")
CAUSE = Cause("weight", "mass", PRIOR, make, say, "an added weight")

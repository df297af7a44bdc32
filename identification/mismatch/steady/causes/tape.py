"""A strip of tape, or dirt, on a propeller: it shakes, and costs a few per cent of that motor's thrust at most.

Below LOSS a damaged blade looks the same in the trim; both are then reported.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nanobench_tools.settings import number

from .cause import Body, Cause, Hypothesis, Size, Sizes, draws, interval, motor_words

LOSS = number("mismatch.tape.loss")


def make(body: Body) -> list[Hypothesis]:
    loss = LOSS * draws(1)[:, 0]
    found = []
    for i in range(4):
        gains = np.zeros((len(loss), 4))
        gains[:, i] = -np.log1p(-loss)
        found.append(Hypothesis("tape", (i + 1,), 0.25, (Size(f"loss_m{i + 1}", "%", 100.0 * loss),), gains))
    return found


def say(sizes: Sizes, motors: Sequence[int]) -> str:
    (size,) = sizes.values()
    return f"The propeller of {motor_words(motors)} is unclean or taped: it gives less by {interval(size, 1, '%')}"


PRIOR = number("mismatch.tape.prior")
CAUSE = Cause("tape", "motor_imbalance", PRIOR, make, say, "tape on a propeller", special_of="propeller")

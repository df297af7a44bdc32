"""A damaged propeller: it gives less thrust at the same voltage, so its motor alone has a higher command.

The thrusts that balance the vehicle are unchanged; only that motor's command changes. A weight cannot cause this: its
moment acts on pairs of motors, never on the yaw balance.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from nanobench_tools.settings import number

from .cause import Body, Cause, Hypothesis, Size, Sizes, draws, interval, motor_words

MOST_LOSS = number("mismatch.propeller.most_loss")
ONE = number("mismatch.propeller.one")


def make(body: Body) -> list[Hypothesis]:
    found = []
    one, two = MOST_LOSS * draws(1), MOST_LOSS * draws(2)
    for motors, loss, share in [*(((i,), one, ONE / 4) for i in range(4)),
                                *((pair, two, (1.0 - ONE) / 6) for pair in combinations(range(4), 2))]:
        gains = np.zeros((len(loss), 4))
        gains[:, list(motors)] = -np.log1p(-loss)
        sizes = tuple(Size(f"loss_m{m + 1}", "%", 100.0 * loss[:, k]) for k, m in enumerate(motors))
        found.append(Hypothesis("propeller", tuple(m + 1 for m in motors), share, sizes, gains))
    return found


def say(sizes: Sizes, motors: Sequence[int]) -> str:
    losses = ", ".join(interval(size, 0, "%") for size in sizes.values())
    word = "propeller" if len(motors) == 1 else "propellers"
    return f"The {word} of {motor_words(motors)} lost thrust: at the same motor voltage it gives less by {losses}"


PRIOR = number("mismatch.propeller.prior")
CAUSE = Cause("propeller", "motor_imbalance", PRIOR, make, say, "a damaged propeller")

"""Gyro against the estimated attitude, axis by axis, in recordings without motion capture to judge either: units of
single axes, and axes that changed places."""

from dataclasses import dataclass

import numpy as np

from ..settings import number
from .axis_unit_matching import FACTOR, FACTOR_WITHIN, ORDERS
from .context import Context
from .estimated_turning import follows_estimate, known_gyro
from .known_factors import NamedFactor, named_factor
from .pairs import gyro_pair, sums_of
from .stream_frames import stream_turns

FOLLOWS = number("audit.own_turning.follows")
CLEARLY = number("audit.own_turning.clearly")


@dataclass(frozen=True)
class OwnTurning:
    """follows (3, 3): correlation of each axis of the gyro with each of the attitude; ratio (3, 3): of their sizes.

    turns (3,): scatter of each axis of the gyro, rad/s."""

    follows: np.ndarray
    ratio: np.ndarray
    turns: np.ndarray

    @property
    def order(self) -> tuple[int, ...]:
        """Axis of the attitude that each axis of the gyro follows; (0, 1, 2) unless another order is clearly better
        on every axis that it moves."""
        size = np.abs(self.follows)
        best = max(ORDERS, key=lambda order: float(size[range(3), order].sum()))
        moved = [i for i in range(3) if best[i] != i]
        clear = all(size[i, best[i]] > FOLLOWS and size[i, best[i]] > size[i, i] + CLEARLY for i in moved)
        return best if clear else (0, 1, 2)

    @property
    def scaled(self) -> list[tuple[int, NamedFactor]]:
        """Axes of the gyro that turn by another factor than the attitude."""
        found = []
        for i, j in enumerate(self.order):
            ratio, follows = float(self.ratio[i, j]), abs(float(self.follows[i, j]))
            if follows > FOLLOWS and abs(np.log(ratio)) > np.log(FACTOR):
                found.append((i, named_factor("rad/s", ratio, FACTOR_WITHIN / follows)))
        return found


def own_turning(context: Context) -> OwnTurning | None:
    """None where motion capture judges the gyro, in other axes as a whole, and without both streams."""
    if sums_of(context, gyro_pair) is not None or any(turn.stream == "imu" for turn in context.once(stream_turns)):
        return None
    found, gyro = context.once(follows_estimate), context.once(known_gyro)
    return None if found is None or gyro is None else OwnTurning(*found, gyro[1].std(axis=0))

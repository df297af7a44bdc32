"""A radio that is silent at times: its packets then wait, and the vehicle goes on with the last ones.

Recordings of the data set are silent for 0 to 11 % of the time. The gaps last 20 to 110 ms (``signals.radio_gaps``).
"""

from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from nanobench_tools.methods import Controller, Reference, VehicleState
from nanobench_tools.settings import number

from .senses import TICK_S

SHORTEST_S = number("control.radio_silence.shortest_s")
LONGER_S = number("control.radio_silence.longer_s")


def silence(rngs: Sequence[np.random.Generator], ticks: int, share: float) -> np.ndarray:
    """(ticks, n) bool: whether the radio of each vehicle is silent in a tick of 10 ms. It is so for ``share`` of the
    time on average (0 to below 1)."""
    if not 0.0 <= share < 1.0:
        raise ValueError(f"a radio that is silent for {share} of the time")
    found = np.zeros((ticks, len(rngs)), bool)
    if share == 0.0:
        return found
    open_s = (SHORTEST_S + LONGER_S) * (1.0 - share) / share
    for lane, rng in enumerate(rngs):
        at = rng.exponential(open_s)
        while at < ticks * TICK_S:
            end = at + SHORTEST_S + rng.exponential(LONGER_S)
            found[round(at / TICK_S):round(end / TICK_S), lane] = True
            at = end + rng.exponential(open_s)
    return found


class Waiting:
    """A controller on the ground behind such a radio: its commands are heard when the radio is not silent."""

    def __init__(self, controller: Controller, silent: np.ndarray) -> None:
        self._controller, self._silent = controller, silent
        self.name, self.information, self.period_s = controller.name, controller.information, controller.period_s

    def reset(self, n: int) -> None:
        self._controller.reset(n)
        self._heard: np.ndarray | None = None

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        given = np.asarray(self._controller.command(time_s, state, reference))
        if self._heard is None or given.shape != self._heard.shape:
            self._heard = given.copy()  # a wrong shape is for who flies it to refuse
        else:
            silent = self._silent[min(int(time_s / TICK_S + 1e-6), len(self._silent) - 1)]
            self._heard[~silent] = given[~silent]
        return self._heard.copy()


def heard(sent: Callable[[int], Reference], silent: np.ndarray) -> Callable[[int], Reference]:
    """Inputs of the vehicles at a tick, each the last that its radio took; the future of a reference is known on
    board."""
    last: list[Reference] = []

    def at(tick: int) -> Reference:
        new = sent(tick)
        if last:
            waits = silent[min(tick, len(silent) - 1)]
            parts: dict[str, Any] = {}
            for field in fields(new):
                value, old = getattr(new, field.name), getattr(last[0], field.name)
                if isinstance(value, np.ndarray) and isinstance(old, np.ndarray):
                    parts[field.name] = np.where(waits.reshape(-1, *[1] * (value.ndim - 1)), old, value)
                else:
                    parts[field.name] = value
            new = Reference(**parts)
        last[:] = [new]
        return new

    return at

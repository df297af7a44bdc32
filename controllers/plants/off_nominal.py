"""Plants that differ from a controller's assumptions in one thing at a time: tests of robustness.

Everything else is that of the median plant. A controller that is not on board sends its commands by a radio that it
believes to be BELIEVED_RADIO_S late.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .ensemble import Ensemble, draw

BELIEVED_RADIO_S = 0.03
LATE_S = 0.02
SHARE = 0.15
LOW_V = 3.3
"""Hovering, that is under load: motors then give 1.30 times the weight."""


def _scaled(names: str, factor: float) -> Callable[[Ensemble, int], None]:
    def change(crowd: Ensemble, i: int) -> None:
        for k, name in enumerate(crowd.model.names):
            if name.startswith(names):
                crowd.parameters[i, k] *= factor
    return change


def _thrust(factor: float) -> Callable[[Ensemble, int], None]:
    return _scaled("motor_imbalance.g", factor)


def _added(what: str, by: float) -> Callable[[Ensemble, int], None]:
    def change(crowd: Ensemble, i: int) -> None:
        getattr(crowd, what)[i] += by
    return change


def _low(crowd: Ensemble, i: int) -> None:
    crowd.hover_V[i] = LOW_V


CASES: dict[str, Callable[[Ensemble, int], None]] = {
    "as told": lambda crowd, i: None,
    "mass +15 %": _scaled("mass.m", 1.0 + SHARE),
    "mass -15 %": _scaled("mass.m", 1.0 - SHARE),
    "thrust +15 %": _thrust(1.0 + SHARE),
    "thrust -15 %": _thrust(1.0 - SHARE),
    "radio +20 ms": _added("radio_s", LATE_S),
    "radio -20 ms": _added("radio_s", -LATE_S),
    "poses +20 ms": _added("delay_s", LATE_S),
    "poses -20 ms": _added("delay_s", -LATE_S),
    "battery 3.3 V": _low,
}
"""Changes of plant i."""


def mismatched(simulator: str, seed: int = 0, radio_s: float = BELIEVED_RADIO_S) -> Ensemble:
    """One plant for each of CASES, all with the same air and noise, about a simulator.toml (its text)."""
    one = draw(simulator, 1, seed, radio_s=radio_s)
    crowd = one.repeated(len(CASES))
    rows = {name: getattr(crowd, name).copy() for name in ("parameters", "hover_V", "delay_s", "radio_s")}
    crowd = replace(crowd, **rows)
    for i, change in enumerate(CASES.values()):
        change(crowd, i)
    return replace(crowd, radio_s=np.maximum(crowd.radio_s, 0.0))

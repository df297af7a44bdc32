"""Wrong beliefs of a shape that no term of the vocabulary has (``nanobench_tools.physics.outside_terms``).

Right is the discrepancy without a false name, or a term whose shape comes near (``near``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from nanobench_tools.physics import Model
from nanobench_tools.physics.outside_terms import CUBE, HEIGHT, PLACE, ROOT, SPEED, TWIST
from nanobench_tools.physics.term import Term

from .beliefs import Flown

DRAGS = ("drag_linear", "drag_quadratic", "drag_rotor", "wind")


@dataclass(frozen=True)
class Outside:
    """As ``beliefs.Belief``; near: terms whose shape comes near, which are no false names."""

    name: str
    term: Term
    start: float
    most: float
    believe: Callable[[Model, float, Flown], Model]
    near: Sequence[str] = ()
    turns: bool = False

    def suits(self, nominal: Model) -> bool:
        """Whether the vehicle's flights can show it at all."""
        return not (self.turns and nominal.vehicle.input == "thrust")


def _place(model: Model, x: float, flown: Flown) -> Model:
    return model.with_term(PLACE.name, f_N=x * model.vehicle.mass_kg, k_1_m=4.0, phase=flown.angle)


def _twisted(model: Model, x: float, flown: Flown) -> Model:
    return model.with_term(TWIST.name, t_Nm=x * model.vehicle.inertia_kg_m2[0], k_1_m=4.0, phase=flown.angle)


def _height(model: Model, x: float, flown: Flown) -> Model:
    return model.with_term(HEIGHT.name, g_1_m=x, z_m=flown.height_m)


def _speed(model: Model, x: float, flown: Flown) -> Model:
    return model.with_term(SPEED.name, g_s_m=x)


def _root_drag(model: Model, x: float, flown: Flown) -> Model:
    return model.with_term(ROOT.name, c=x * model.vehicle.mass_kg)


def _cube_drag(model: Model, x: float, flown: Flown) -> Model:
    return model.with_term(CUBE.name, c=x * model.vehicle.mass_kg)


OUTSIDE = (
    Outside("force of place", PLACE, 0.02, 8.0, _place),
    Outside("moment of place", TWIST, 0.5, 300.0, _twisted, turns=True),
    Outside("gain by height", HEIGHT, 0.01, 1.0, _height, ("ground_effect",)),
    Outside("gain by speed", SPEED, 0.005, 0.5, _speed, ("inflow",)),
    Outside("drag, root", ROOT, 0.02, 8.0, _root_drag, DRAGS),
    Outside("drag, cube", CUBE, 0.02, 8.0, _cube_drag, DRAGS),
)

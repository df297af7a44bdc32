"""Wrong beliefs of a shape that no term of the vocabulary has.

They are terms that a simulator can hold and that no diagnosis asks for. Right is the discrepancy without a false name,
or a term whose shape comes near (``near``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from nanobench_tools.physics import Model
from nanobench_tools.physics.ops import Ops
from nanobench_tools.physics.systematic import NOTHING
from nanobench_tools.physics.term import Parameter, Situation, Stage, Term
from nanobench_tools.physics.vector import Components, add, scale

from .beliefs import Flown

WHY = "outside the vocabulary"


def _name(attribute: str) -> str:
    """Under which ``lookup.registry`` finds a term that is not registered."""
    return f"{__name__}:{attribute}"


def _numbers(*names: tuple[str, str], length: int = 0) -> tuple[Parameter, ...]:
    return tuple(Parameter(name, unit, -1e3, 1e3, 0.0, source=WHY, length=length, systematic=NOTHING, in_product=True)
                 for name, unit in names)


def _wave(force: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    x, y, _ = at.position_m
    return add(force, [p.f_N * ops.sin(p.k_1_m * y + p.phase), p.f_N * ops.sin(p.k_1_m * x + p.phase), 0.0 * x])


def _higher(thrust: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    return scale(1.0 + p.g_1_m * (at.position_m[2] - p.z_m), thrust)


def _faster(thrust: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    x, y, z = at.velocity_b
    return scale(1.0 + p.g_s_m * ops.sqrt(x * x + y * y + z * z + 1e-6), thrust)


def _root(force: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    x, y, z = at.air_b
    speed = ops.sqrt(x * x + y * y + z * z + 1e-6)
    return add(force, scale(-p.c / ops.sqrt(speed), [x, y, z]))


def _cube(force: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    x, y, z = at.air_b
    return add(force, scale(-p.c * (x * x + y * y + z * z), [x, y, z]))


def _twist(torque: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    x, y, _ = at.position_m
    return add(torque, [p.t_Nm * ops.sin(p.k_1_m * y + p.phase), p.t_Nm * ops.sin(p.k_1_m * x + p.phase), 0.0 * x])


PLACE = Term(_name("PLACE"), "A sideways force that changes with the place.", "F <- F + f sin(k x + phase)",
             _numbers(("f_N", "N"), ("k_1_m", "1/m"), ("phase", "rad")), {Stage.WORLD_FORCE: _wave}, not_asked=WHY)
TWIST = Term(_name("TWIST"), "A moment that changes with the place.", "tau <- tau + t sin(k x + phase)",
             _numbers(("t_Nm", "N m"), ("k_1_m", "1/m"), ("phase", "rad")), {Stage.TORQUE: _twist}, not_asked=WHY)
HEIGHT = Term(_name("HEIGHT"), "Thrust that changes with the height.", "T <- T (1 + g (z - z_0))",
              _numbers(("g_1_m", "1/m"), ("z_m", "m")), {Stage.GROUND: _higher}, not_asked=WHY)
SPEED = Term(_name("SPEED"), "Thrust that changes with the speed.", "T <- T (1 + g |v|)",
             _numbers(("g_s_m", "s/m")), {Stage.INFLOW: _faster}, not_asked=WHY)
ROOT = Term(_name("ROOT"), "Drag with the root of the speed.", "F_b <- F_b - c |v|^-0.5 v",
            _numbers(("c", "N s^.5/m^.5")), {Stage.BODY_FORCE: _root}, not_asked=WHY)
CUBE = Term(_name("CUBE"), "Drag with the cube of the speed.", "F_b <- F_b - c |v|^2 v",
            _numbers(("c", "N s^3/m^3")), {Stage.BODY_FORCE: _cube}, not_asked=WHY)

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

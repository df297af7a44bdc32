"""Forces of a shape that no term of the vocabulary has, as terms that a simulator can hold.

No diagnosis asks for them: a simulator that believes in one shows what a diagnosis does with physics without a name.
"""

from types import SimpleNamespace
from typing import Any

from .ops import Ops
from .systematic import NOTHING
from .term import Parameter, Situation, Stage, Term
from .vector import Components, add, scale

WHY = "outside the vocabulary"


def _name(attribute: str) -> str:
    """Under which ``lookup.registry`` finds a term that is not registered."""
    return f"{__name__}:{attribute}"


def _numbers(*names: tuple[str, str]) -> tuple[Parameter, ...]:
    return tuple(Parameter(name, unit, -1e3, 1e3, 0.0, source=WHY, systematic=NOTHING, in_product=True)
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

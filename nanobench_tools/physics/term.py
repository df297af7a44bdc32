"""What a physical effect consists of: its parameters, the stage of the evaluation it acts on, and its expression."""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from .ops import Ops


class Stage(enum.IntEnum):
    """Where a term acts, in the order of evaluation. The value that an expression is given and gives back:

    MASS kg; INERTIA [Jx, Jy, Jz] kg m^2; WIND [x, y, z] m/s world; INPUT_DELAY and INPUT_LIMIT the motors' inputs (PWM
    ratio or rad/s); THRUST_MAP inputs -> thrusts N; THRUST_LIMIT, THRUST_SCALE, MOTOR_GAIN the thrusts asked for;
    LAG (tau_up, tau_down) s; ROTOR_SPEED lagged thrusts -> rotor speeds rad/s; INFLOW and GROUND the thrusts;
    BODY_FORCE N and TORQUE N m, body; WORLD_FORCE N, world; TILT the whole body force N.
    """

    MASS = 1
    INERTIA = 2
    WIND = 3
    INPUT_DELAY = 4
    INPUT_LIMIT = 5
    THRUST_MAP = 6
    THRUST_LIMIT = 7
    THRUST_SCALE = 8
    MOTOR_GAIN = 9
    LAG = 10
    ROTOR_SPEED = 11
    INFLOW = 12
    GROUND = 13
    BODY_FORCE = 14
    TORQUE = 15
    WORLD_FORCE = 16
    TILT = 17


@dataclass(frozen=True)
class Parameter:
    """One entry of a term, scalar (``length`` 0), fixed length, any length from 1 on (None), or one element for
    every rotor (``"rotors"``).

    ``lower`` and ``upper`` bound every element physically; ``neutral`` is the value of an element at which the term
    has no effect: a number, the key of the same quantity of the vehicle, or None when there is no such value.
    ``typical`` is an order of magnitude for a 40 g quadrotor (a start for a fit), ``source`` says where it is from.
    A ``^k`` in ``unit`` stands for the number of the element.
    """

    name: str
    unit: str
    lower: float
    upper: float
    typical: float | tuple[float, ...]
    source: str
    neutral: float | str | None = 0.0
    length: int | str | None = 0
    optional: bool = False

    def unit_of(self, element: int) -> str:
        """Unit of one element: N/V^k -> N, N/V, N/V^2 ..."""
        if "^k" not in self.unit:
            return self.unit
        top, _, bottom = self.unit.partition("/")
        return {0: top, 1: f"{top}/{bottom.removesuffix('^k')}"}.get(element, self.unit.replace("^k", f"^{element}"))

    def length_on(self, rotors: int) -> int | None:
        """Elements on a vehicle of so many rotors; 0 of a scalar, None for any."""
        return rotors if isinstance(self.length, str) else self.length

    def element_name(self, element: int) -> str:
        """``s`` of a scalar, ``c[1]`` of a list."""
        return self.name if self.length == 0 else f"{self.name}[{element}]"


@dataclass
class Situation:
    """What an expression may look at beside its own value; filled while the stages are evaluated.

    Lists hold components. ``before`` and ``whole_rows`` belong to command_delay: the input one row earlier, and how
    many whole rows both have been shifted by already.
    """

    vehicle: Any
    row_s: float
    battery_V: Any = None
    before: Sequence[Any] = ()
    whole_rows: Any = 0.0
    gain: Sequence[Any] = ()
    position_m: Sequence[Any] = ()
    rate_rad_s: Sequence[Any] = ()
    velocity_b: Sequence[Any] = ()
    air_b: Sequence[Any] = ()
    thrust_N: Sequence[Any] = ()
    rotor_rad_s: Sequence[Any] = ()
    force_b: Sequence[Any] = ()


Expression = Callable[[Any, Any, Situation, Ops], Any]
"""(value of the stage, parameters by attribute, situation, functions) -> new value of the stage."""


@dataclass(frozen=True)
class Term:
    """One physical effect. ``confused_with``: other effect -> the flight that tells them apart. ``check`` looks at the
    values of all parameters ({name: float or tuple}) and returns what is wrong and what to do, or None. ``needs`` are
    groups of terms of which one has to be in the model too.
    """

    name: str
    sentence: str
    equation: str
    parameters: tuple[Parameter, ...]
    acts: Mapping[Stage, Expression]
    confused_with: Mapping[str, str] = field(default_factory=dict)
    needs: tuple[str, ...] = ()
    check: Callable[[Mapping[str, Any]], tuple[str, str] | None] | None = None

    @property
    def stage(self) -> Stage:
        """The first stage it acts on."""
        return min(self.acts)

    def parameter(self, name: str) -> Parameter:
        """By name; raises KeyError."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise KeyError(name)

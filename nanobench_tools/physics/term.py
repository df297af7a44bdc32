"""What a physical effect consists of: its parameters, the stage of the evaluation it acts on, and its expression."""

import enum
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from .ops import Ops
from .systematic import Systematic
from .vehicle import Vehicle


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
class Belief:
    """Of one element before any flight: ``mean`` and standard deviation ``sd`` in its unit, and where it is from."""

    mean: float
    sd: float
    source: str


@dataclass(frozen=True)
class Parameter:
    """One entry of a term.

    ``length``: 0 for a scalar, a fixed length, or None for any length from 1 on. ``"rotors"``: one element per rotor.

    ``lower`` and ``upper`` bound every element physically. ``neutral``: value of an element without an effect: a
    number, the key of the same quantity of the vehicle, or None. ``typical``: order of magnitude for a 40 g quadrotor
    (a start for a fit); ``source``: its origin. A ``^k`` in ``unit`` is the number of the element. ``only_input``: only
    on vehicles of this input. ``fixed_mean``: of a list whose mean is given by definition.

    For fits, ``fitted`` (lower, upper, why) is narrower than the physical bounds. It may be a function of the vehicle
    that gives (lower, upper) of every element. ``believed``: a prior, or a function of the vehicle that gives one or
    None for every element. ``unidentifiable``: elements that flights do not show.

    For diagnoses: ``systematic``: error from logging alone (None: the relative error of the drag laws). ``differs``:
    variation between flights without a cause (None: as ``systematic``). ``grows`` with m (mass), l (length of the
    arms), /w (speed of all rotors in hover). ``implausible``: from this factor on. ``search_start``: start of the
    search for effects that are far from linear at rest. It is a value, or ``inputs`` or ``thrusts`` for a limit of
    those. ``in_product``: observable only times another parameter of its term, so not fitted alone. ``only_with``:
    element -> term that makes it observable.
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
    only_input: str = ""
    fixed_mean: float | None = None
    fitted: tuple[float, float, str] | Callable[[Vehicle], Sequence[tuple[float, float]]] | None = None
    believed: Belief | Callable[[Vehicle], Sequence[Belief | None]] | None = None
    unidentifiable: tuple[int, ...] = ()
    systematic: Systematic | None = None
    differs: float | None = None
    grows: str = ""
    implausible: float | None = None
    search_start: float | str | None = None
    in_product: bool = False
    only_with: Mapping[int, str] = field(default_factory=dict, hash=False)

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
    """Other quantities that an expression may use; filled while the stages are evaluated.

    Lists contain components. ``before`` and ``whole_rows`` belong to command_delay. They are the input one row
    earlier, and the number of whole rows by which both are already shifted. ``lagged_N`` and ``command_N``: rotor
    thrusts before inflow, and the command that they follow with ``tau_s`` (up, down). Empty for steady rotors.
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
    lagged_N: Sequence[Any] = ()
    command_N: Sequence[Any] = ()
    tau_s: tuple[Any, Any] | None = None
    rotor_rad_s: Sequence[Any] = ()
    force_b: Sequence[Any] = ()


Expression = Callable[[Any, Any, Situation, Ops], Any]
"""(value of the stage, parameters by attribute, situation, functions) -> new value of the stage."""


@dataclass(frozen=True)
class Term:
    """One physical effect.

    ``confused_with``: other effect -> the flight that separates them. ``check`` gets the values of all parameters
    ({name: float or tuple}) and returns the mistake and its remedy, or None. ``needs``: groups of terms of which one
    has to be in the model too. ``input``: of a thrust map, its vehicle input.

    For diagnoses: ``level``: any thrust curve contains it. ``changes``: it may change between two flights.
    ``scatters``: per-flight elements. ``of_air``: a force of the air that no steady moment alone shows. ``answered``: a
    slope of thrust that resembles the controller's answers to gusts. ``far``: so far from linear that a first order
    ranks it badly. ``frame``: where it is fixed (by default that of its stage). ``cause``: possible change of the
    vehicle.

    ``left_out``: target of an export -> replacement there, ``""`` for all others. ``injector``: "module:Class" of an
    ``identification.prove`` effect that flies it in blind cases, by default its own expressions. ``sizes``: {"small",
    "medium", "large"} -> values of its parameters there, by default fractions of the typical ones. ``not_asked``:
    reason for excluding it from a diagnosis if the simulator lacks it; otherwise empty.
    """

    name: str
    sentence: str
    equation: str
    parameters: tuple[Parameter, ...]
    acts: Mapping[Stage, Expression]
    confused_with: Mapping[str, str] = field(default_factory=dict)
    needs: tuple[str, ...] = ()
    check: Callable[[Mapping[str, Any]], tuple[str, str] | None] | None = None
    input: str = "pwm"
    level: bool = False
    changes: bool = False
    scatters: tuple[str, ...] = ()
    of_air: bool = False
    answered: bool = False
    far: bool = False
    frame: str = ""
    cause: str | None = None
    left_out: Mapping[str, str] = field(default_factory=dict)
    injector: str = ""
    sizes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    not_asked: str = ""

    @property
    def is_map(self) -> bool:
        """Whether it turns inputs into thrusts."""
        return Stage.THRUST_MAP in self.acts

    @property
    def on_commands(self) -> bool:
        """Whether all it does lies between a command and the thrust asked for."""
        return all(Stage.INPUT_DELAY <= stage <= Stage.MOTOR_GAIN for stage in self.acts)

    @property
    def only_turns(self) -> bool:
        """Whether it turns the vehicle and pushes it nowhere."""
        even = [Stage.MOTOR_GAIN] if all(p.fixed_mean is not None for p in self.parameters) else []
        return all(stage in (Stage.INERTIA, Stage.TORQUE, *even) for stage in self.acts)

    @property
    def is_limit(self) -> bool:
        """Whether it limits inputs or thrusts, and has no slope where it rests."""
        return any(isinstance(p.search_start, str) for p in self.parameters)

    @property
    def in_products(self) -> bool:
        """Whether only a product of its parameters is observable, though some of them are fitted."""
        return any(p.in_product for p in self.parameters) and not all(p.in_product for p in self.parameters)

    @property
    def fixed_in(self) -> str:
        """``frame``, or what the stage says: world or body."""
        return self.frame or ("world" if {Stage.WIND, Stage.WORLD_FORCE} & set(self.acts) else "body")

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

"""A model as simulators see it that take rotor speeds: rotors with one thrust coefficient on a rigid body."""

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ...errors import InputError
from ..equations import Equations
from ..model import Model
from ..ops import NUMPY
from ..term import Stage
from ..vehicle import Vehicle

QUADROTOR = 4
RAD_S_PER_RPM = math.pi / 30.0


@dataclass(frozen=True)
class Assumed:
    """What a model may not hold and others ask for; every one that is used is written into the file.

    - battery_V: at which the greatest thrust is evaluated (default: nominal voltage of a LiPo cell).
    - k_f [N s^2/rad^2]: of a model without rotor speeds; it only gives their scale (default: Crazyflie of RotorPy).
    - thrust_to_weight: of a model whose input is a rotor speed without a limit.
    """

    battery_V: float = 3.7
    k_f: float = 2.3e-8
    thrust_to_weight: float = 2.0

    def __post_init__(self) -> None:
        bounds = {"battery_V": (1.0, 60.0), "k_f": (1e-11, 1e-4), "thrust_to_weight": (1.05, 20.0)}
        for entry in fields(self):
            low, high = bounds[entry.name]
            if not low <= getattr(self, entry.name) <= high:  # nan is outside too
                raise InputError(f"assumed {entry.name}", f"{getattr(self, entry.name)!r}",
                                 f"give a number from {low:g} to {high:g}")


@dataclass(frozen=True)
class Rotors:
    """Effective numbers of a model: mass, inertia and motors (x, y, z from the centre of mass) according to its terms.

    k_f [N s^2/rad^2] and k_m [N m s^2/rad^2] turn the square of a rotor speed into thrust and yaw torque; ``tau_s``
    (up, down) or None; hover_rad_s one rotor in hover, sum_rad_s all four; thrust_max_N one motor. ``assumed``:
    assumptions.
    """

    mass_kg: float
    inertia_kg_m2: tuple[float, float, float]
    motors_m: tuple[tuple[float, float, float], ...]
    spin: tuple[float, ...]
    gravity_m_s2: float
    k_f: float
    k_m: float
    tau_s: tuple[float, float] | None
    hover_rad_s: float
    thrust_max_N: float
    assumed: dict[str, str]

    @property
    def hover_N(self) -> float:
        """Thrust of one motor in hover."""
        return self.mass_kg * self.gravity_m_s2 / 4.0

    @property
    def sum_rad_s(self) -> float:
        return 4.0 * self.hover_rad_s

    @property
    def speed_max_rad_s(self) -> float:
        return math.sqrt(self.thrust_max_N / self.k_f)


def get(model: Model, term: str, parameter: str, default: Any) -> Any:
    """A parameter of a term, or the default of a model without it."""
    return model.values_of(term).get(parameter, default) if term in model else default


def rotors(model: Model, assumed: Assumed) -> Rotors:
    """The effective numbers. Raises InputError for another number of rotors than four, which these simulators require,
    and for a model that cannot hover under the assumptions."""
    vehicle, used = model.vehicle, {}
    if vehicle.rotors != QUADROTOR:
        raise InputError("model", f"{vehicle.rotors} rotors, and the simulators of rotors that files are written for "
                         f"take {QUADROTOR}", "export it as c or casadi")
    mass = get(model, "mass", "m", vehicle.mass_kg)
    r = get(model, "com_offset", "r_m", (0.0, 0.0, 0.0))
    if vehicle.input == "thrust":
        raise InputError("model", "input is thrust in N", "give it a thrust map, or export it as c or casadi")
    k_f = get(model, "thrust_rpm", "k_f", None)
    if k_f is None:
        k_f = assumed.k_f
        used["k_f"] = f"{k_f:g} N s^2/rad^2: the model knows no rotor speeds; forces do not depend on it"
    if vehicle.input == "rpm":  # of measured speeds; with PWM the scale is part of the thrust asked for
        k_f *= get(model, "thrust_scale", "s", 1.0)
    weight = mass * vehicle.gravity_m_s2
    if weight <= 0.0:
        raise InputError("model", "gravity is 0", "simulators of rotors need a hover")
    greatest = _greatest_thrust(model, assumed, weight, used)
    if 4.0 * greatest <= weight:
        at = f" at {assumed.battery_V:g} V" if vehicle.input == "pwm" else ""
        raise InputError("model", f"cannot hover: greatest thrust of a motor {greatest:.4g} N{at}, a quarter of the "
                         f"weight is {weight / 4.0:.4g} N",
                         "assume another battery voltage" if at else "look at T_max_N")
    lag = model.values_of("motor_lag") if "motor_lag" in model else None
    return Rotors(
        mass_kg=mass, inertia_kg_m2=get(model, "inertia", "inertia_kg_m2", vehicle.inertia_kg_m2),
        motors_m=tuple((x - r[0], y - r[1], 0.0 - r[2]) for x, y in vehicle.motor_positions_m), spin=vehicle.spin,
        gravity_m_s2=vehicle.gravity_m_s2, k_f=k_f, k_m=k_f * get(model, "yaw_torque", "k_m", 0.0),
        tau_s=(lag["tau_up_s"], lag["tau_down_s"]) if lag else None, hover_rad_s=math.sqrt(weight / 4.0 / k_f),
        thrust_max_N=greatest, assumed=used)


def _greatest_thrust(model: Model, assumed: Assumed, weight: float, used: dict[str, str]) -> float:
    """Of the strongest motor at any command [N]."""
    if model.vehicle.input == "pwm":
        used["battery_V"] = f"{assumed.battery_V:g} V: greatest thrust, at this voltage and any PWM"
        command = Equations(commands(model), commands(model).values.tolist(), NUMPY, 1.0)
        ratio = np.linspace(0.0, 1.0, 201)
        return float(max(np.max(t) for t in command.command([ratio] * 4 + [np.full(201, assumed.battery_V)])))
    limit = get(model, "saturation", "T_max_N", None)
    if limit is not None:
        return float(limit * get(model, "thrust_scale", "s", 1.0) * max(get(model, "motor_imbalance", "g", (1.0,))))
    used["thrust_to_weight"] = f"{assumed.thrust_to_weight:g}: greatest thrust, the model has no limit"
    return assumed.thrust_to_weight * weight / 4.0


def commands(model: Model, delayed: bool = False) -> Model:
    """The part of a model between a command and the thrust asked for, ``delayed`` with its delay."""
    kept = [term for term in model.terms if term.on_commands or (term.is_map and term.input == model.vehicle.input)]
    names = {term.name for term in kept if delayed or Stage.INPUT_DELAY not in term.acts}
    return Model(Vehicle(input=model.vehicle.input), {k: v for k, v in model.as_dict().items() if k in names})


def command_lines(model: Model, k_f: float) -> list[str]:
    """How a command becomes a rotor speed, in words and numbers, for a comment."""
    what = "PWM ratio u_i (0..1) and battery voltage V" if model.vehicle.input == "pwm" else "Omega_i [rad/s]"
    lines = [f"Rotor speeds to command, from {what}:"]
    for term in sorted(commands(model, delayed=True).terms, key=lambda term: term.stage):
        numbers = ", ".join(f"{k} = {list(v) if isinstance(v, tuple) else v} {term.parameter(k).unit.removesuffix('1')}"
                            .rstrip() for k, v in model.values_of(term.name).items())
        lines.append(f"  {term.equation}   with {numbers}")
    return [*lines, f"  Omega_i = sqrt(max(T_i, 0) / k)   with k = {k_f!r} N s^2/rad^2"]

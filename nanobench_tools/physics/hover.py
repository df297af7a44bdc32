"""Where a vehicle hovers, and how strongly its motors turn it there: what a pilot checks before trusting a model."""

from dataclasses import dataclass

import numpy as np

from ..errors import UsageError
from ..results.result import Result
from . import numeric
from .inputs import settled
from .model import QUATERNION, RATE, RIGID, ROTOR, VELOCITY, Model
from .vehicle import Vehicle

BATTERY_V = 3.7
"""Nominal voltage of one lithium cell."""
STEP = 1e-2
"""Change of a motor, as a fraction of its hover command, for which an authority is given."""
UNITS = {"pwm": "PWM ratio", "rpm": "rad/s", "thrust": "N"}
AXES = ("roll", "pitch", "yaw")


@dataclass(frozen=True, repr=False)
class Hover(Result):
    """Steady hover in still air at battery_V, height_m above the ground.

    - motor (n,): commands in ``unit``.
    - thrust_N (n,): commanded rotor thrust.
    - roll_deg, pitch_deg: tilt at which it does not move.
    - authority_rad_s2: angular acceleration about body x, y, z [rad/s^2] with settled rotors. Every motor changes by 1
      % of its command in the direction of that turn."""

    motor: tuple[float, ...]
    unit: str
    battery_V: float
    height_m: float
    thrust_N: tuple[float, ...]
    roll_deg: float
    pitch_deg: float
    authority_rad_s2: tuple[float, float, float]

    @property
    def sentence(self) -> str:
        """One line for people."""
        turns = ", ".join(f"{name} {value:.3g}" for name, value in zip(AXES, self.authority_rad_s2, strict=True))
        return (f"hovers at {', '.join(f'{m:.3g}' for m in self.motor)} {self.unit} ({self.battery_V:g} V); 1 % more "
                f"and less of the motors turns it by {turns} rad/s^2")


def doubts(model: Model) -> list[str]:
    """Implausible parameters of ``model``, one line each: further from published values than the factor of their term.

    The values are those of thrust measurements and of the firmware.
    """
    found = []
    arm = np.mean(np.hypot(*np.transpose(model.vehicle.motor_positions_m)))
    usual_arm = np.mean(np.hypot(*np.transpose(Vehicle().motor_positions_m)))
    for slot, value in zip(model.slots, model.values.tolist(), strict=True):
        parameter = slot.parameter
        if parameter.implausible and isinstance(parameter.typical, float) and parameter.typical:
            usual = parameter.typical * (arm / usual_arm) ** parameter.grows.count("l")
            factor = abs(value / usual)
            if not 1.0 / parameter.implausible <= factor <= parameter.implausible:
                found.append(f"{slot.name} is {value:.3g} {parameter.unit_of(slot.element)}, {factor:.2g} times the "
                             f"usual {usual:.3g} ({parameter.source}): it may predict, but is no vehicle")
    return found


def row_of(model: Model, motor: np.ndarray, battery_V: float) -> np.ndarray:
    """Inputs (1, I) of motors (n,) that have stood still for long, in the order of ``Model.inputs``."""
    late = [*motor, 0.0] if "command_delay" in model else []
    return np.array([[*motor, battery_V, *late]])


def state_of(model: Model, roll: float, pitch: float, thrust_N: np.ndarray) -> np.ndarray:
    """States (1, S) at rest at the origin of the world, tilted by roll and pitch [rad], with these rotor states."""
    state = np.zeros((1, RIGID + model.rotors))
    half = np.array([roll, pitch]) / 2.0
    (sr, sp), (cr, cp) = np.sin(half), np.cos(half)
    state[0, QUATERNION] = sr * cp, cr * sp, -sr * sp, cr * cp
    state[0, ROTOR] = thrust_N
    return state


def hover(model: Model, battery_V: float = BATTERY_V, height_m: float = 1.0) -> Hover:
    """The hover of ``model``, ``height_m`` above the ground: the least-norm motors and tilt at which velocity and rate
    stay constant. Raises UsageError with the remainder if it cannot hover."""
    from scipy.optimize import least_squares

    weight = model.vehicle.mass_kg * model.vehicle.gravity_m_s2
    start = {"pwm": 0.5, "rpm": 1000.0, "thrust": weight / model.rotors}[model.vehicle.input]

    def at(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        row = row_of(model, start * x[2:], battery_V)
        thrust = settled(model, row.T, row_hz=model.vehicle.rate_hz)[:, 0]
        state = state_of(model, x[0], x[1], thrust)
        state[0, 2] = height_m
        return numeric.derivative(model, state, row)[0], thrust

    def left(x: np.ndarray) -> np.ndarray:
        slope = at(x)[0]
        return np.concatenate([slope[VELOCITY], slope[RATE] * np.asarray(model.vehicle.inertia_kg_m2) /
                               (weight * np.abs(model.vehicle.motor_positions_m).max())])

    found = least_squares(left, np.array([0.0, 0.0, *np.ones(model.rotors)]), x_scale="jac")
    slope, thrust = at(found.x)
    if not np.all(np.abs(left(found.x)) < 1e-3):
        raise UsageError(f"this model hovers at no command at {battery_V:g} V: "
                         f"{np.linalg.norm(slope[VELOCITY]):.2g} m/s^2 are left")
    motor = start * found.x[2:]
    return Hover(tuple(motor.tolist()), UNITS[model.vehicle.input], battery_V, height_m,
                 tuple(thrust.tolist()), float(np.degrees(found.x[0])), float(np.degrees(found.x[1])),
                 _authority(model, found.x[:2], motor, battery_V, height_m))


def _authority(model: Model, tilt: np.ndarray, motor: np.ndarray, battery_V: float,
               height_m: float) -> tuple[float, float, float]:
    where = np.array(model.vehicle.motor_positions_m)
    senses = np.array([np.sign(where[:, 1]), -np.sign(where[:, 0]), np.sign(model.vehicle.spin)])
    found = []
    for axis, sense in enumerate(senses):
        rates = []
        for way in (1.0, -1.0):
            row = row_of(model, motor * (1.0 + way * STEP * sense), battery_V)
            state = state_of(model, float(tilt[0]), float(tilt[1]),
                             settled(model, row.T, row_hz=model.vehicle.rate_hz)[:, 0])
            state[0, 2] = height_m
            rates.append(numeric.derivative(model, state, row)[0, RATE][axis])
        found.append(float(rates[0] - rates[1]) / 2.0)
    return found[0], found[1], found[2]

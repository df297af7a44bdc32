"""The plant of Task 2: n vehicles of an identified model behind their batteries, stepped together in compiled code.

The equations are those of ``nanobench_tools.physics`` (terms of simulator.toml), one lane of a vector each. This file
adds what closes a loop: delayed commands, a battery that sags, legs on the ground, and forces of the air. What the
vehicle believes of its state is in ``senses``, a flight in ``closed_loop``.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from nanobench_tools.errors import InputError
from nanobench_tools.firmware.guard import REST_BATTERY_V
from nanobench_tools.firmware.thrust_curve import thrust_of_voltage
from nanobench_tools.physics import Model
from nanobench_tools.physics.inputs import parameter_values, rows, settled
from nanobench_tools.physics.model import QUATERNION, RIGID, ROTOR, STATE, VELOCITY
from nanobench_tools.physics.rollout import compiled_step
from nanobench_tools.practice.rigid_bodies import CONTACT_RAD_S, battery_load, legs

STEP_S = 0.002
"""Step of the integration and shortest period of a controller."""
MOST_DELAY_S = 1.0


class Battery(Protocol):
    """``volts(time_s, motor (4, n))`` -> terminal voltage (n,) V."""

    def volts(self, time_s: float, motor: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True)
class Cell:
    """Open-circuit voltage (n,) V behind resistance (n,) ohm; the motors draw like conductances. It does not run down:
    35 s in the air take a sixth of the charge, 0.1 V."""

    open_circuit_V: np.ndarray
    resistance_ohm: np.ndarray
    conductance_A_V: np.ndarray

    def volts(self, time_s: float, motor: np.ndarray) -> np.ndarray:
        return self.open_circuit_V / (1.0 + battery_load(motor, self.resistance_ohm, self.conductance_A_V))


@dataclass(frozen=True)
class Trace:
    """A battery that was logged: volts (m, n) every ``every_s`` from the start on, the last one held."""

    volts_V: np.ndarray
    every_s: float

    def volts(self, time_s: float, motor: np.ndarray) -> np.ndarray:
        at = min(time_s / self.every_s, len(self.volts_V) - 1.0)
        low = int(at)
        high = min(low + 1, len(self.volts_V) - 1)
        return np.asarray(self.volts_V[low] + (at - low) * (self.volts_V[high] - self.volts_V[low]))


def closed_loop_model(model: Model) -> Model:
    """The model with terms through which the world can push it: mass and a force that may change every step.

    Raises InputError for a model of rotor speeds or with a rate that is held.
    """
    if model.vehicle.input != "pwm":
        raise InputError("simulator", f"its input is {model.vehicle.input}", "a plant takes PWM; give another one")
    if "mass" not in model:
        model = model.with_term("mass", m=model.vehicle.mass_kg)
    return model if "force_world" in model else model.with_term("force_world", f_N=(0.0, 0.0, 0.0))


class Plant:
    """n vehicles in the air. ``start`` (n, 13) position, velocity, quaternion, rate; ``motor`` (n, 4) PWM ratios flown
    until now, to which the rotors have settled. Or ``past`` (n, P, 4), at 100 Hz, newest last.

    ``parameters`` (n, P) of ``model``'s flat vector, by default the model's own for all; ``ground_z`` (n,): where the
    tracked point rests on the ground. ``force_N`` (3, n) pushes from outside and may be set between steps. Raises
    InputError for shapes that do not fit and for a delay beyond a second.
    """

    def __init__(self, model: Model, start: np.ndarray, motor: np.ndarray, battery: Battery, *,
                 parameters: np.ndarray | None = None, ground_z: np.ndarray | float = -np.inf,
                 step_s: float = STEP_S) -> None:
        self.model, self.battery, self.step_s = closed_loop_model(model), battery, step_s
        start, motor = np.asarray(start, float), np.asarray(motor, float)
        n = len(start)
        if start.shape != (n, RIGID) or motor.shape != (n, 4):
            raise InputError("plant", f"start {start.shape}, motor {motor.shape}", f"give ({n}, 13) and ({n}, 4)")
        values = parameter_values(self.model, parameters if parameters is None else _joined(self.model, parameters))
        self.parameters = np.array(np.broadcast_to(values, (n, values.shape[-1])).T, order="C")
        self._force = self._slots("force_world.f_N")
        self._steady_N = self.parameters[self._force].copy()
        self._weight_kg = self.parameters[self.model.index("mass.m")]
        self.force_N = np.zeros((3, n))
        self.time_s = 0.0
        self.ground_z = np.broadcast_to(np.asarray(ground_z, float), (n,)) + (
            self.model.vehicle.gravity_m_s2 / CONTACT_RAD_S**2)
        self.motor = np.ascontiguousarray(motor.T)
        self.battery_V = battery.volts(0.0, self.motor)
        self.state = np.zeros((len(STATE), n))
        self.state[:RIGID] = start.T
        self.state[QUATERNION] /= np.linalg.norm(self.state[QUATERNION], axis=0)
        self._row = np.zeros((1, len(self.model.inputs), n))
        self._begin_delay(n)
        self._step = compiled_step(self.model, 1.0 / step_s, own_parameters=True)
        self._write_row()
        self.state[ROTOR] = settled(self.model, self._row[0], row_hz=1.0 / step_s, parameters=self.parameters.T)

    def __len__(self) -> int:
        return self.state.shape[1]

    def _slots(self, name: str) -> list[int]:
        return [self.model.index(f"{name}[{i}]") for i in range(3)]

    def _begin_delay(self, n: int) -> None:
        self._depth = 1
        self._count = 0
        if "command_delay" not in self.model:
            return
        delay = self.parameters[self.model.index("command_delay.delay_s")]
        if not np.all((delay >= 0.0) & (delay <= MOST_DELAY_S)):
            raise InputError("plant", f"command_delay of {np.max(delay):g} s", f"at most {MOST_DELAY_S:g} s")
        self._whole = np.floor(delay / self.step_s + 1e-9).astype(int)
        self._depth = int(self._whole.max()) + 2
        self._waiting = np.tile(self.motor, (self._depth, 1, 1))
        self._row[0, 9] = self._whole
        self._lane = np.arange(n)

    def _write_row(self) -> None:
        """Inputs of the next step: motors as they are or were when the delay began, battery."""
        row = self._row[0]
        row[4] = self.battery_V
        if self._depth == 1:
            row[:4] = self.motor
            return
        self._waiting[self._count % self._depth] = self.motor
        now = (self._count - self._whole) % self._depth
        row[:4] = self._waiting[now, :, self._lane].T
        row[5:9] = self._waiting[now - 1, :, self._lane].T  # index -1 is the last of the ring

    def advance(self, motor: np.ndarray) -> None:
        """One step with PWM ratios motor (n, 4), clipped to 0..1."""
        self.motor = np.ascontiguousarray(np.clip(motor, 0.0, 1.0).T)
        self.battery_V = self.battery.volts(self.time_s, self.motor)
        self._write_row()
        self._count += 1
        self.parameters[self._force] = self._steady_N + self.force_N
        depth = self.ground_z - self.state[2]
        if (depth > 0.0).any():
            self.parameters[self._force] += self._weight_kg * legs(depth, self.state[VELOCITY])
        self.before_m_s = self.state[VELOCITY]
        self.state = self._step(self.state, self._row, self.parameters, keep="last")[0]
        self.time_s += self.step_s


def _joined(model: Model, parameters: np.ndarray) -> np.ndarray:
    """Parameters (n, P) of a model before ``closed_loop_model`` added terms at its end -> of the model after it."""
    given = np.asarray(parameters, float)
    missing = len(model.names) - given.shape[-1]
    if missing <= 0:
        return given
    return np.concatenate([given, np.broadcast_to(model.values[-missing:], (*given.shape[:-1], missing))], axis=-1)


def hover_ratio(model: Model, battery_V: np.ndarray, parameters: np.ndarray | None = None) -> np.ndarray:
    """(n,) equal PWM ratio at which vehicles of ``model`` carry their weight at voltages (n,); 1 where none does."""
    model = closed_loop_model(model)
    n = len(battery_V)
    values = parameter_values(model, parameters if parameters is None else _joined(model, parameters))
    weight = np.broadcast_to(values, (n, values.shape[-1]))[:, model.index("mass.m")] * model.vehicle.gravity_m_s2
    low, high = np.zeros(n), np.ones(n)
    for _ in range(30):
        middle = 0.5 * (low + high)
        motor = np.repeat(middle[:, None, None], 4, axis=2)
        row, _ = rows(model, motor, np.asarray(battery_V, float)[:, None], row_hz=1.0 / STEP_S, parameters=values)
        lift = settled(model, row[0], row_hz=1.0 / STEP_S, parameters=values).sum(axis=0)
        low, high = np.where(lift < weight, middle, low), np.where(lift < weight, high, middle)
    return high


def share_of_firmware(model: Model) -> float:
    """Thrust of a rotor of ``model`` at hover over what the firmware's thrust curve promises for that motor voltage, at
    REST_BATTERY_V. Raises InputError as ``closed_loop_model``."""
    volts = np.array([REST_BATTERY_V])
    hover_N = closed_loop_model(model).values_of("mass")["m"] * model.vehicle.gravity_m_s2 / model.rotors
    return float(hover_N / thrust_of_voltage(hover_ratio(model, volts) * volts)[0])

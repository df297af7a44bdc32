"""A vehicle of an identified model with the firmware on board, as the simulated Crazyflie is served with it."""

import ctypes
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.firmware.pid import low_pass
from nanobench_tools.firmware.stabilizer import ACC_HZ, GYRO_HZ, Stabilizer
from nanobench_tools.physics import Model
from nanobench_tools.physics.batched import LANES
from nanobench_tools.physics.model import POSITION, QUATERNION, RATE, STATE, VELOCITY
from nanobench_tools.physics.rollout import compiled_step
from nanobench_tools.physics.simulator import loads, read_simulator
from nanobench_tools.practice.rigid_bodies import CONTACT_RAD_S
from nanobench_tools.practice.vehicle_parameters import OPEN_CIRCUIT, VEHICLE

from .downwash import TURNS, SharedAir
from .plant import MOST_DELAY_S, closed_loop_model
from .served_loop import NOISES, STEP_S, WORLD, run

SIMULATOR = "recorded_vehicle.toml"
BATTERY_V = (2.6, float(OPEN_CIRCUIT[-1, 1]))
"""Voltages at rest that a cell may start with."""
DISCONNECTED_V = 4.15
"""Of a cell that was charged and taken off the charger."""


def noise_share(corner_hz: float) -> float:
    """Standard deviation of white 1 kHz noise behind the firmware's low pass over that in front of it."""
    b0, b1, b2, a1, a2 = low_pass(1000.0, corner_hz)
    d1 = d2 = total = 0.0
    for k in range(400):
        d0 = (1.0 if k == 0 else 0.0) - a1 * d1 - a2 * d2
        total += (b0 * d0 + b1 * d1 + b2 * d2) ** 2
        d1, d2 = d0, d1
    return float(np.sqrt(total))


class ServedVehicle:
    """One vehicle at rest on the ground, the firmware of ``stabilizer`` on board; ``advance`` runs both.

    ``battery_V``: of the cell at rest. ``wind_m_s`` (3,) world: the air moves so. ``noise``: of gyro and accelerometer
    over the recordings'; ``air``: unrest of the air over theirs. ``start_m`` (3,), yaw_rad: initial position and
    heading. Raises InputError for a model that no plant can be made of, for a delay above a second, a voltage outside
    BATTERY_V.
    """

    def __init__(self, model: Model, *, battery_V: float = DISCONNECTED_V, wind_m_s: Sequence[float] = (0.0, 0.0, 0.0),
                 start_m: Sequence[float] = (0.0, 0.0, 0.0), yaw_rad: float = 0.0, noise: float = 1.0, air: float = 1.0,
                 seed: int = 0, tick_ms: int = 1000) -> None:
        if any(wind_m_s):
            model = model.with_term("wind", w_m_s=tuple(float(v) for v in wind_m_s))
        if not BATTERY_V[0] <= battery_V <= BATTERY_V[1]:
            raise InputError("battery", f"{battery_V:g} V", f"at rest a cell has {BATTERY_V[0]:g} to {BATTERY_V[1]:g}")
        self.model = closed_loop_model(model)
        self._start = (tuple(start_m), yaw_rad, battery_V, tick_ms)
        self.air: SharedAir | None = None
        self._push_N = np.zeros(3)
        self._rng = np.random.default_rng([seed, 77])
        self._step = compiled_step(self.model, 1.0 / STEP_S, own_parameters=True)
        self._parameters = np.ascontiguousarray(np.repeat(self.model.values[:, None], LANES, axis=1))
        self._row = np.zeros((len(self.model.inputs), LANES))
        self._state = np.zeros((len(STATE), LANES))
        self._world = np.zeros(1, WORLD)
        self._begin(noise, air)
        self.restart()
        self.advance(0)  # compiles, which takes a minute the first time

    def restart(self) -> None:
        """A hand puts it back where it stood, with a full battery, and switches it on."""
        start_m, yaw_rad, battery_V, tick_ms = self._start
        self.stabilizer = Stabilizer(tick_ms)
        self._world["charge"], self._world["battery_V"] = _charge(battery_V), battery_V
        self._world["motor"], self._waiting[:] = 0.0, 0.0
        self.place(start_m, yaw_rad)

    def _begin(self, noise: float, air: float) -> None:
        w, model = self._world[0], self.model
        w["address"] = ctypes.cast(self._step.machine_code, ctypes.c_void_p).value
        w["force"] = model.index("force_world.f_N[0]")
        w["steady_N"] = [model.parameters[f"force_world.f_N[{i}]"] for i in range(3)]
        w["mass_kg"], w["gravity"] = model.parameters["mass.m"], model.vehicle.gravity_m_s2
        w["capacity_A_s"] = VEHICLE["capacity_A_s"].value
        w["resistance_ohm"] = VEHICLE["resistance_ohm"].value
        w["conductance_A_V"] = VEHICLE["motor_conductance_A_V"].value
        w["battery_noise_V"] = 0.004 * noise
        w["air_sd_m_s2"] = VEHICLE["disturbance_m_s2"].value * air
        acc, gyro = noise / noise_share(ACC_HZ), noise / noise_share(GYRO_HZ)
        w["sigma"] = [acc * VEHICLE["acc_noise_m_s2"].value, acc * VEHICLE["acc_vibration_m_s2"].value,
                      gyro * VEHICLE["gyro_noise_rad_s"].value, gyro * VEHICLE["gyro_vibration_rad_s"].value]
        w["acc_bias"] = noise * VEHICLE["acc_bias_m_s2"].spread * self._rng.standard_normal(3)
        w["floor_V"], w["floor_ratio"] = _zero(model, "thrust_voltage"), _zero(model, "thrust_pwm")
        depth = 0
        if "command_delay" in model:
            delay = model.parameters["command_delay.delay_s"]
            if not 0.0 <= delay <= MOST_DELAY_S:
                raise InputError("simulator", f"command_delay of {delay:g} s", f"at most {MOST_DELAY_S:g} s")
            w["whole"] = int(delay / STEP_S + 1e-9)
            self._row[9] = w["whole"]
            depth = int(w["whole"]) + 2
        w["ring"] = depth
        self._waiting = np.zeros((max(depth, 1), 4))

    def place(self, position_m: Sequence[float], yaw_rad: float = 0.0, ground_m: float | None = None) -> None:
        """At rest, as a hand would put it, rotors still; the ground is there from now on, or at ``ground_m``."""
        self._state[:] = 0.0
        self._state[POSITION] = np.asarray(position_m, float)[:, None]
        self._state[QUATERNION] = so3.exp(np.array([0.0, 0.0, yaw_rad]))[:, None]
        w = self._world[0]
        w["ground_z"] = (position_m[2] if ground_m is None else ground_m) + w["gravity"] / CONTACT_RAD_S**2
        w["before_m_s"] = 0.0

    def advance(self, milliseconds: int) -> None:
        """So many loops of the firmware, and of the world around it."""
        s = self.stabilizer
        if self.air is not None:
            self._world["push_N"][0] = self._push_N + self.air.force_N(self)
        noise = self._rng.standard_normal((milliseconds, NOISES))
        run(noise, s.loop, s.setpoint, s.gains, s.states, s.build, s.kalman, s.task, s.run, s.measured,
            s.waiting, self._world, self._state, self._row, self._parameters, self._waiting)
        s.waiting = 0

    def true_pose(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """position m, velocity m/s (3,) world, quaternion (4,) of the tracked point now."""
        x = self._state[:, 0]
        return x[POSITION].copy(), x[VELOCITY].copy(), x[QUATERNION].copy()

    @property
    def rate_rad_s(self) -> np.ndarray:
        """(3,) body."""
        return self._state[RATE, 0].copy()

    @property
    def battery_V(self) -> float:
        """Terminal voltage now."""
        return float(self._world["battery_V"][0])

    def push(self, force_N: Sequence[float]) -> None:
        """A force (3,) from outside, world, from now on."""
        self._push_N = np.array(force_N, float)
        self._world["push_N"][0] = self._push_N

    @property
    def place_m(self) -> tuple[float, float, float]:
        """Position now, as plain numbers."""
        x, y, z = self._state[POSITION, 0].tolist()
        return x, y, z

    @property
    def hover_N(self) -> float:
        """Thrust of a hover."""
        return float(self._world["mass_kg"][0] * self._world["gravity"][0])

    @property
    def rotors_turn(self) -> bool:
        """Whether there is a jet below it."""
        return float(self._world["motor"][0].mean()) > TURNS


def _zero(model: Model, term: str) -> float:
    """Where the polynomial of a thrust map begins to be positive, 0 for one that is nowhere negative or not there."""
    if term not in model:
        return 0.0
    at = np.linspace(0.0, 5.0, 5001)
    thrust = np.polynomial.polynomial.polyval(at, model.values_of(term)["c"])
    below = np.flatnonzero(thrust[:1000] < 0.0)
    return float(at[below[-1] + 1]) if len(below) else 0.0


def _charge(battery_V: float) -> float:
    """Charge left at which a cell at rest has this voltage."""
    if battery_V < OPEN_CIRCUIT[0, 1]:
        return float((battery_V - OPEN_CIRCUIT[0, 1]) / 20.0)
    return float(np.interp(battery_V, OPEN_CIRCUIT[:, 1], OPEN_CIRCUIT[:, 0]))


def served_simulator() -> str:
    """Text of the simulator.toml of the vehicle that is served when none is named."""
    return resources.files(__package__).joinpath(SIMULATOR).read_text(encoding="utf-8")


def served(simulator: Path | None = None, **settings: Any) -> ServedVehicle:
    """A ServedVehicle of a simulator.toml, by default ``served_simulator``; ``settings`` are passed on."""
    return ServedVehicle(loads(served_simulator()) if simulator is None else read_simulator(simulator), **settings)

"""RotorPy as a simulator: our states and commands in, our states out, its physics in between.

World z up, body x forward, y left, z up, quaternions x, y, z, w body to world on both sides; RotorPy's rotor speeds are
rotor states here as thrusts k_eta Omega^2. Its integrator is set to a tight tolerance (its own default is 1e-3).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import lfilter

from ... import so3
from ...errors import InputError, MissingExtraError
from ...results.result_files import read_json
from ..equations import Equations
from ..export.rotorpy_params import SCHEMA, commands_beside, quad_params
from ..inputs import rows
from ..model import POSITION, QUATERNION, RATE, RIGID, ROTOR, STATE, VELOCITY, Model
from ..ops import NUMPY
from ..vehicle import Vehicle
from .given import UP, Along
from .pwm import CURVE, in_our_order, stated

NUMBERS = ("mass", "Ixx", "Iyy", "Izz", "Ixy", "Iyz", "Ixz", "rotor_speed_min", "rotor_speed_max", "k_eta", "k_m",
           "tau_m")
"""Numbers RotorPy cannot do without."""
POSITIVE = ("mass", "Ixx", "Iyy", "Izz", "rotor_speed_max", "k_eta", "k_m", "tau_m")


class RotorPySimulator:
    """RotorPy's ``Multirotor`` with four rotors, flown by rotor speeds.

    ``quad_params``: RotorPy's dictionary (lists or arrays). ``commands``: the part of a model that turns PWM and
    battery voltage into thrust, for ``speeds``. ``wind_m_s``: constant, world. Without ``rotors_lag`` rotors have the
    speed that is commanded at once. ``tolerance``: relative, of the integration. Raises MissingExtraError without
    RotorPy, InputError for parameters that it cannot fly.
    """

    def __init__(self, quad_params: Mapping[str, Any], commands: Model | None = None,
                 wind_m_s: Sequence[float] = (0.0, 0.0, 0.0), rotors_lag: bool = True, tolerance: float = 1e-8,
                 place: str = "quad_params") -> None:
        params = checked(quad_params, place)
        try:
            from rotorpy.vehicles.multirotor import Multirotor
        except ImportError:
            raise MissingExtraError("rotorpy", "rotorpy") from None
        self.commands, self.wind_m_s, self.rotors_lag = commands, np.asarray(wind_m_s, float), rotors_lag
        self.k_f = float(params["k_eta"])
        self.vehicle = Multirotor(params, integrator_kwargs={"method": "DOP853", "rtol": tolerance,
                                                             "atol": 1e-3 * tolerance})

    @classmethod
    def from_file(cls, path: Path | str, tolerance: float = 1e-8) -> RotorPySimulator:
        """From the JSON of ``nanobench convert --to rotorpy``, or RotorPy's parameters in any JSON file."""
        params = read_json(Path(path))
        beside = params.pop("nanobench", None)
        if beside is None:
            return cls(params, tolerance=tolerance, place=str(path))
        try:
            if beside["schema"] != SCHEMA:
                raise InputError(f"{path}: key nanobench", f"schema is {beside['schema']!r}", f"{SCHEMA!r} is needed")
            commands = Model(Vehicle(input=beside["commands"]["input"]), beside["commands"]["terms"])
            wind, lag = beside["wind_m_s"], beside["rotors_lag"]
        except (KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{path}: key nanobench", f"cannot be used ({error})", "write the file anew") from None
        return cls(params, commands, wind, bool(lag), tolerance, str(path))

    @classmethod
    def from_model(cls, model: Model, place: str = "model") -> RotorPySimulator:
        """A model as RotorPy flies it, by way of ``nanobench convert --to rotorpy``."""
        beside = commands_beside(model)
        return cls(quad_params(model)[0], Model(Vehicle(input=model.vehicle.input), beside["commands"]["terms"]),
                   beside["wind_m_s"], beside["rotors_lag"], place=place)

    def speeds(self, motor: np.ndarray, battery_V: np.ndarray | None = None, *, row_hz: float) -> np.ndarray:
        """Commands (n, 4), PWM ratio or rad/s, and battery voltage (n,) -> rotor speeds to command (n, 4) rad/s."""
        if self.commands is None:
            raise InputError("RotorPy", "no map from PWM to rotor speed came with the parameters",
                             "give rotor speeds, or parameters written by nanobench convert --to rotorpy")
        motor = np.asarray(motor, float)
        battery_V = np.zeros(len(motor)) if battery_V is None else battery_V
        given = rows(self.commands, motor[None], np.asarray(battery_V, float)[None], row_hz=row_hz)[0][..., 0]
        commanded = Equations(self.commands, self.commands.values.tolist(), NUMPY, 1.0 / row_hz).command(list(given.T))
        return np.asarray(np.sqrt(np.maximum(np.stack(commanded, axis=-1), 0.0) / self.k_f))

    def rollout(self, start_state: np.ndarray, rotor_speeds: np.ndarray, dt_s: float) -> np.ndarray:
        """start_state (13,) or (17,) in the order of ``model.STATE``, commanded speeds (n, 4) rad/s, each held for
        dt_s.

        Returns states (n + 1, 17), the last four thrusts N of still air. Rotors that are not given have the first
        speed."""
        start, commanded = np.asarray(start_state, float), np.asarray(rotor_speeds, float)
        if start.shape not in ((RIGID,), (len(STATE),)) or commanded.ndim != 2 or commanded.shape[1] != 4:
            raise InputError("rollout", f"start {start.shape}, rotor speeds {commanded.shape}",
                             f"give ({RIGID},) or ({len(STATE)},) and (rows, 4)")
        if not (np.isfinite(start).all() and np.isfinite(commanded).all() and dt_s > 0.0):
            raise InputError("rollout", "a state, a speed or the time step is not finite", "leave such rows out")
        states = np.empty((len(commanded) + 1, len(STATE)))
        states[0, :RIGID] = start[:RIGID]
        states[0, QUATERNION] /= np.linalg.norm(start[QUATERNION])
        given = np.sqrt(np.maximum(start[ROTOR], 0.0) / self.k_f) if len(start) > RIGID else commanded[:1].reshape(-1)
        state = {"x": states[0, POSITION], "v": states[0, VELOCITY], "q": states[0, QUATERNION],
                 "w": states[0, RATE], "wind": self.wind_m_s, "rotor_speeds": given if len(given) else np.zeros(4)}
        states[0, ROTOR] = self.k_f * state["rotor_speeds"] ** 2
        for row, command in enumerate(commanded, start=1):
            if not self.rotors_lag:
                state["rotor_speeds"] = np.clip(command, self.vehicle.rotor_speed_min, self.vehicle.rotor_speed_max)
            state = self.vehicle.step(state, {"cmd_motor_speeds": command}, dt_s)
            states[row] = np.concatenate([state["x"], state["v"], state["q"], state["w"],
                                          self.k_f * state["rotor_speeds"] ** 2])
        return states

    def accelerations(self, states: np.ndarray) -> np.ndarray:
        """states (n, 17) -> derivatives of velocity m/s^2, world, and body rate rad/s^2 (n, 6), rotors as they are."""
        states = np.asarray(states, float)
        if states.ndim != 2 or states.shape[1] != len(STATE):
            raise InputError("accelerations", f"states {states.shape}", f"give (rows, {len(STATE)})")
        speeds = np.sqrt(np.maximum(states[:, ROTOR], 0.0) / self.k_f)
        found = [self.vehicle.statedot({"x": s[POSITION], "v": s[VELOCITY], "q": s[QUATERNION], "w": s[RATE],
                                        "wind": self.wind_m_s, "rotor_speeds": speed}, {"cmd_motor_speeds": speed}, 0.0)
                 for s, speed in zip(states, speeds, strict=True)]
        return np.array([[*one["vdot"], *one["wdot"]] for one in found]).reshape(-1, 6)

    def turning(self, commanded: np.ndarray, row_s: float) -> np.ndarray:
        """Rotor speeds (n, 4) rad/s at the start of rows that ask for speeds (n, 4), settled on the first."""
        commanded = np.clip(commanded, self.vehicle.rotor_speed_min, self.vehicle.rotor_speed_max)
        if not self.rotors_lag:
            return commanded
        keep = np.exp(-row_s / self.vehicle.tau_m)
        return np.asarray(lfilter([0.0, 1.0 - keep], [1.0, -keep], commanded, axis=0, zi=commanded[:1])[0])

    @property
    def own(self) -> Vehicle:
        """Mass and arms as RotorPy has them."""
        about = self.vehicle
        places = [np.asarray(place, float) for place in about.rotor_pos.values()]
        return Vehicle(float(about.mass), tuple(float(j) for j in np.diag(about.inertia)),  # type: ignore[arg-type]
                       tuple((float(p[0]), float(p[1])) for p in places),
                       tuple(float(d) for d in np.ravel(about.rotor_dir)))


@dataclass(frozen=True)
class RotorPyAlong:
    """RotorPy evaluated along measured states: see ``given``. ``notes`` say what had to be assumed."""

    simulator: RotorPySimulator
    vehicle: Vehicle
    notes: tuple[str, ...] = ()

    def __call__(self, along: Along) -> tuple[np.ndarray, np.ndarray]:
        commanded = self.simulator.speeds(along.motor, along.battery_V, row_hz=1.0 / along.row_s)
        speeds = self.simulator.turning(commanded, along.row_s)
        states = np.concatenate([along.position_m, along.velocity_m_s, along.quaternion, along.rate_rad_s,
                                 self.simulator.k_f * speeds**2], axis=1)
        found = self.simulator.accelerations(states)
        return so3.rotate_inverse(along.quaternion, found[:, :3] + UP), found[:, 3:]


def simulator(argument: str | None) -> RotorPyAlong:
    """``rotorpy``: RotorPy's own Crazyflie; ``rotorpy:FILE``: a simulator.toml, or parameters in JSON."""
    if argument is None:
        try:
            from rotorpy.vehicles.crazyflie_params import quad_params as crazyflie
        except ImportError:
            raise MissingExtraError("rotorpy", "rotorpy") from None
        there = RotorPySimulator(in_our_order(crazyflie), CURVE)
        return RotorPyAlong(there, there.own, stated("RotorPy's own Crazyflie", there.own.mass_kg))
    path = Path(argument)
    if path.suffix != ".json":
        from ..simulator import read_simulator

        there = RotorPySimulator.from_model(read_simulator(path), argument)
        return RotorPyAlong(there, there.own)
    there = RotorPySimulator.from_file(path)
    notes: tuple[str, ...] = ()
    if there.commands is None:
        there.commands, notes = CURVE, stated(argument, there.own.mass_kg)
    return RotorPyAlong(there, there.own, notes)


def checked(quad_params: Mapping[str, Any], place: str) -> dict[str, Any]:
    """RotorPy's parameters with arrays where it wants them; raises InputError that names the key."""
    params = dict(quad_params)
    for key in NUMBERS:
        if key not in params:
            raise InputError(f"{place}: key {key}", "is missing", "RotorPy needs it")
    for key, value in params.items():
        if key in ("rotor_pos", "rotor_directions", "rI"):
            continue
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
            raise InputError(f"{place}: key {key}", f"{value!r} is no finite number", "mend it")
    for key in POSITIVE:
        if params[key] <= 0:
            raise InputError(f"{place}: key {key}", f"{params[key]!r}", "give a positive number")
    places = params.get("rotor_pos")
    positions = list(places.values()) if isinstance(places, Mapping) else []
    arrays = {"rotor_pos": (positions, (4, 3)), "rotor_directions": (params.get("rotor_directions"), (4,))}
    for key, (value, shape) in arrays.items():
        try:
            array = np.asarray(value, float)
        except (TypeError, ValueError):
            array = np.empty(0)
        if array.shape != shape or not np.isfinite(array).all():
            raise InputError(f"{place}: key {key}", "is not what four rotors need", f"give numbers {shape}")
        params[key] = array
    params["rotor_pos"] = dict(zip(places, params["rotor_pos"], strict=True))  # type: ignore[arg-type]
    return params

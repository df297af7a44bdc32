"""A vehicle with the trim of the flight: four gains of the motors from the rows before the start, then its physics.

    f = m a_z + d_z v_z,   M = J dw/dt + w x J w + d_r w - c e3 x v         measured, rows before the start

    [f; M] - A T = A diag(T) e + noise,   e ~ N(0, GAIN_SD^2)               A: sum, arms, yaw moment of the thrusts T

The balance is a mean over these rows with the weight exp(-age / MEMORY_S). e has its posterior mean and is constant
over the window. No parameter of the vehicle changes, and its file has none of this.
"""

from dataclasses import dataclass
from typing import cast

import numpy as np

from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.methods import Past, Prediction, Windows
from nanobench_tools.physics import Model
from nanobench_tools.physics.inputs import rows, settled
from nanobench_tools.physics.model import POSITION, QUATERNION, RATE, VELOCITY
from nanobench_tools.physics.rollout import compiled_lagged, rollout
from nanobench_tools.settings import number, setting

MEMORY_S = number("vehicle.trimmed_predictor.memory_s")
GAIN_SD = number("vehicle.trimmed_predictor.gain_sd")
NOISE: tuple[float, float, float, float] = setting("vehicle.trimmed_predictor.noise")


@dataclass(frozen=True)
class TrimmedPredictor:
    """``model``: with ``motor_imbalance``, whose gains are multiplied by 1 + e."""

    model: Model
    name: str
    information: str = "past"

    def gains(self, windows: Windows) -> np.ndarray:
        """(n, rotors) e of every motor; 0 where the flight had not begun."""
        past = windows.past
        if past is None:
            raise InputError(f"predictor {self.name}", "windows without the streams before the start",
                             "cut them with past=True")
        row_s, count = 1.0 / windows.rate_hz, past.motor.shape[1]
        thrust = self._thrust(past, windows.rate_hz)
        mixing = self._mixing()
        missing = self._measured(past, row_s) - thrust @ mixing.T
        age = row_s * np.arange(count, 0, -1)
        weight = np.exp(-age / MEMORY_S) * (np.arange(count) >= count - past.rows[:, None])
        seen = weight.sum(axis=1) > 0.0
        weight = weight[seen] / weight[seen].sum(axis=1, keepdims=True)
        y, mean = (np.einsum("np,npk->nk", weight, x[seen]) for x in (missing, thrust))
        slope = mixing * mean[:, None]
        inertia = np.array(self.model.values_of("inertia")["inertia_kg_m2"])
        size = np.array([self.model.vehicle.mass_kg, *inertia])
        noise = np.array(NOISE) * size**2 * np.sum(weight**2, axis=1, keepdims=True) / row_s
        turned = slope.transpose(0, 2, 1)
        total = GAIN_SD**2 * slope @ turned + noise[:, :, None] * np.eye(4)
        found = np.zeros((len(windows), self.model.rotors))
        found[seen] = (GAIN_SD**2 * turned @ np.linalg.solve(total, y[..., None]))[..., 0]
        return found

    def _mixing(self) -> np.ndarray:
        """(4, rotors): thrusts -> force along body z and moments."""
        vehicle = self.model.vehicle
        x, y = np.array(vehicle.motor_positions_m).T
        yaw = self.model.parameters["yaw_torque.k_m"]
        return np.stack([np.ones(len(x)), y, -x, yaw * np.array(vehicle.spin)])

    def _thrust(self, past: Past, rate_hz: float) -> np.ndarray:
        """(n, P, rotors) N of the model at the rows before the start."""
        commands, _ = rows(self.model, past.motor, past.battery_V, row_hz=rate_hz)
        first = settled(self.model, commands[0], row_hz=rate_hz)
        found = compiled_lagged(self.model, rate_hz)(first, commands, self.model.values)[0]
        return np.asarray(found[:-1].transpose(2, 0, 1))

    def _measured(self, past: Past, row_s: float) -> np.ndarray:
        """(n, P, 4): force along body z [N] and moments [N m] that the motors gave."""
        model, rate = self.model, past.rate_rad_s
        inertia = np.array(model.values_of("inertia")["inertia_kg_m2"])
        drag, damping = (np.array(model.values_of(term)[key]) for term, key in (
            ("drag_linear", "d"), ("angular_damping", "d_r")))
        air = model.parameters["drag_torque.c"]
        body = so3.rotate_inverse(past.quaternion.reshape(-1, 4), past.velocity_m_s.reshape(-1, 3)).reshape(rate.shape)
        force = past.specific_force_m_s2[..., 2]
        if np.isnan(force).any():  # no accelerometer: from the velocity
            gravity = np.array([0.0, 0.0, model.vehicle.gravity_m_s2])
            gained = np.gradient(past.velocity_m_s, row_s, axis=1) + gravity
            turned = so3.rotate_inverse(past.quaternion.reshape(-1, 4), gained.reshape(-1, 3))
            force = turned.reshape(rate.shape)[..., 2]
        moment = inertia * np.gradient(rate, row_s, axis=1) + np.cross(rate, inertia * rate) + damping * rate
        moment[..., 0] += air * body[..., 1]
        moment[..., 1] -= air * body[..., 0]
        return np.concatenate([(model.vehicle.mass_kg * force + drag[2] * body[..., 2])[..., None], moment], axis=-1)

    def predict(self, windows: Windows) -> Prediction:
        """States 1..H steps after the start."""
        found, past = self.gains(windows), cast("Past", windows.past)
        values = np.tile(self.model.values, (len(windows), 1))
        values[:, [self.model.index(f"motor_imbalance.g[{i}]") for i in range(self.model.rotors)]] *= 1.0 + found
        start = np.concatenate([windows.position_m, windows.velocity_m_s, windows.quaternion, windows.rate_rad_s], 1)
        states = rollout(self.model, start, windows.motor, windows.battery_V, (past.motor, past.battery_V),
                         row_hz=windows.rate_hz, parameters=values)[:, 1:]
        return Prediction(*(states[..., part] for part in (POSITION, VELOCITY, QUATERNION, RATE)))

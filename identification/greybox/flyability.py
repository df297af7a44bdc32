"""Does the fitted model fly? It hovers at the PWM that was logged, and a plain controller holds it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nanobench_tools import so3
from nanobench_tools.physics import Model, numeric
from nanobench_tools.physics.inputs import settled
from nanobench_tools.physics.model import POSITION, QUATERNION, RATE, VELOCITY
from nanobench_tools.settings import number

from .arrays import FitWindows

SECONDS = number("greybox.flyability.seconds")
POSITION_GAIN = number("greybox.flyability.position_gain")
VELOCITY_GAIN = number("greybox.flyability.velocity_gain")
ATTITUDE_GAIN = number("greybox.flyability.attitude_gain")
RATE_GAIN = number("greybox.flyability.rate_gain")
"""1/s^2 and 1/s: a crossover near 8 rad/s, slow enough for 0.1 s of delay and lag."""
NEAR_M = number("greybox.flyability.near_m")
NEAR_RAD = number("greybox.flyability.near_rad")
SLOW_M_S = number("greybox.flyability.slow_m_s")
SLOW_RAD_S = number("greybox.flyability.slow_rad_s")
HOVER_WITHIN = number("greybox.flyability.hover_within")
LEVELS = 200


@dataclass(frozen=True)
class Flight:
    """stable: a controller brings the model from off-set starts to the point; error_m at the end; hover_ratio: PWM that
    holds the model over the PWM logged near hover, at the same voltage."""

    stable: bool
    error_m: float
    hover_ratio: float

    @property
    def flies(self) -> bool:
        return self.stable and abs(self.hover_ratio - 1.0) < HOVER_WITHIN

    def __str__(self) -> str:
        held = f"held by a plain controller ({1e3 * self.error_m:.0f} mm after {SECONDS:.0f} s)"
        return (f"{held if self.stable else 'NOT held by a plain controller'}, "
                f"hovers at {100.0 * self.hover_ratio:.1f} % of the logged PWM")


def flies(model: Model, data: FitWindows) -> Flight:
    """Flies ``model`` for a few seconds; ``data`` tells what was logged near hover."""
    error, tilt = _hold(model, float(np.median(data.battery_V)))
    stable = bool(np.isfinite(error) and error < NEAR_M and tilt < NEAR_RAD)
    return Flight(stable, float(error), hover_ratio(model, data))


def thrusts(model: Model, u: np.ndarray, battery_V: float) -> np.ndarray:
    """Settled thrust of each motor (4, n) [N] at PWM ratios u (n,)."""
    row = np.zeros((len(model.inputs), len(u)))
    row[:4], row[4] = u, battery_V
    row[5:9] = u if len(row) > 5 else row[5:9]
    return settled(model, row, row_hz=model.vehicle.rate_hz)


def hover_ratio(model: Model, data: FitWindows) -> float:
    """PWM the model needs to carry its weight over the mean PWM logged at the starts of slow windows."""
    slow = ((np.linalg.norm(data.start[:, VELOCITY], axis=1) < SLOW_M_S)
            & (np.linalg.norm(data.start[:, RATE], axis=1) < SLOW_RAD_S))
    slow = slow if slow.sum() >= 10 else np.ones(len(slow), bool)
    logged, volts = float(data.past[0][slow].mean()), float(data.battery_V[slow].mean())
    u = np.linspace(0.0, 1.5, LEVELS)
    lift = thrusts(model, u, volts).sum(axis=0)
    weight = model.vehicle.mass_kg * model.vehicle.gravity_m_s2
    return float(np.interp(weight, np.maximum.accumulate(lift), u)) / logged


def _hold(model: Model, battery_V: float) -> tuple[float, float]:
    """(largest distance m, largest tilt rad) at the end, of starts beside the point and tilted."""
    rng = np.random.default_rng(0)
    n, row_s, point = 8, 1.0 / model.vehicle.rate_hz, np.array([0.0, 0.0, 1.0])
    state = np.zeros((n, 17))
    state[:, POSITION] = rng.uniform(-0.3, 0.3, (n, 3)) + point
    state[:, QUATERNION] = so3.exp(rng.uniform(-0.2, 0.2, (n, 3)))
    levels = np.linspace(0.0, 1.2, LEVELS)
    curve = thrusts(model, levels, battery_V)
    weight = model.vehicle.mass_kg * model.vehicle.gravity_m_s2
    state[:, 13:] = weight / 4.0
    arms = np.array(model.vehicle.motor_positions_m)
    inertia = np.array(model.values_of("inertia").get("inertia_kg_m2", model.vehicle.inertia_kg_m2))
    mix = np.linalg.pinv(np.array([np.ones(4), arms[:, 1], -arms[:, 0]]))
    delay = int(model.parameters.get("command_delay.delay_s", 0.0) / row_s)
    waiting = [np.full((n, 4), np.interp(weight / 4.0, curve.mean(axis=0), levels))] * (delay + 2)
    turned = np.inf
    with np.errstate(all="ignore"):
        for _ in range(int(SECONDS / row_s)):
            off = np.clip(point - state[:, POSITION], -0.5, 0.5)
            wanted = POSITION_GAIN * off - VELOCITY_GAIN * state[:, VELOCITY]
            wanted[:, 2] += model.vehicle.gravity_m_s2
            body = so3.rotate_inverse(state[:, QUATERNION], wanted)
            lean = np.stack([-body[:, 1], body[:, 0]], axis=1) / np.maximum(body[:, 2:], 1.0)
            moment = inertia[:2] * (ATTITUDE_GAIN * lean - RATE_GAIN * state[:, RATE][:, :2])
            lift = model.vehicle.mass_kg * np.linalg.norm(wanted, axis=1)
            commanded = np.column_stack([lift, moment]) @ mix.T
            u = np.stack([np.interp(commanded[:, i], np.maximum.accumulate(curve[i]), levels) for i in range(4)],
                         axis=1)
            waiting = [*waiting[1:], u]
            row = np.zeros((n, len(model.inputs)))
            row[:, :4], row[:, 4] = waiting[1], battery_V
            if row.shape[1] > 5:
                row[:, 5:9], row[:, 9] = waiting[0], delay
            state = numeric.step(model, state, row)
            if not np.isfinite(state).all():
                return np.inf, np.inf
            up = so3.rotate(state[:, QUATERNION], np.array([0.0, 0.0, 1.0]))
            turned = float(np.arccos(np.clip(up[:, 2].min(), -1.0, 1.0)))
    return float(np.linalg.norm(state[:, POSITION] - point, axis=1).max()), turned

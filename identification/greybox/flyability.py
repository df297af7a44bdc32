"""Does the fitted model fly? It hovers at the PWM that was logged, and a plain controller holds it."""

from dataclasses import dataclass

import numpy as np

from nanobench_tools import so3
from nanobench_tools.physics import Model, numeric
from nanobench_tools.physics.inputs import settled
from nanobench_tools.physics.model import POSITION, QUATERNION, RATE, VELOCITY
from nanobench_tools.settings import count, number, setting

from .arrays import FitWindows

SECONDS = number("greybox.flyability.seconds")
POSITION_GAIN = number("greybox.flyability.position_gain")
VELOCITY_GAIN = number("greybox.flyability.velocity_gain")
ATTITUDE_GAINS: tuple[tuple[float, float], ...] = setting("greybox.flyability.attitude_gains")
"""(attitude 1/s^2, rate 1/s): a slow and a fast loop. The slow one is for vehicles with 0.1 s of delay and lag. The
fast one is for those that the air tips over when they move. A vehicle flies if either holds it."""
NEAR_M = number("greybox.flyability.near_m")
NEAR_RAD = number("greybox.flyability.near_rad")
SLOW_M_S = number("greybox.flyability.slow_m_s")
SLOW_RAD_S = number("greybox.flyability.slow_rad_s")
STEADY_M_S2 = number("greybox.flyability.steady_m_s2")
IDLE = number("greybox.flyability.idle")
FEWEST_WINDOWS = count("greybox.flyability.fewest_windows")
HOVER_WITHIN = number("greybox.flyability.hover_within")
LEVELS = 200


@dataclass(frozen=True)
class Flight:
    """Whether a fitted model flies.

    - stable: a controller brings the model from off-set starts to the point.
    - error_m: at the end.
    - hover_ratio: PWM that holds the model over ``logged_hover``, the mean PWM ratio logged near hover, at the same
      voltage battery_V."""

    stable: bool
    error_m: float
    hover_ratio: float
    logged_hover: float
    battery_V: float

    @property
    def flies(self) -> bool:
        return self.stable and abs(self.hover_ratio - 1.0) < HOVER_WITHIN

    def __str__(self) -> str:
        held = f"held by a plain controller ({1e3 * self.error_m:.0f} mm after {SECONDS:.0f} s)"
        modelled = self.hover_ratio * self.logged_hover
        return (f"{held if self.stable else 'NOT held by a plain controller'}, hovers at "
                f"{100.0 * self.hover_ratio:.1f} % of the logged PWM ({modelled:.4f} against {self.logged_hover:.4f}, "
                f"{self.battery_V:.2f} V)")


def flies(model: Model, data: FitWindows) -> Flight:
    """Fly ``model`` for a few seconds; ``data``: the logged values near hover."""
    battery_V = float(np.median(data.battery_V))
    errors = []
    for gains in ATTITUDE_GAINS:
        error, tilt = _hold(model, battery_V, *gains)
        errors.append(float(error))
        if stable := bool(np.isfinite(error) and error < NEAR_M and tilt < NEAR_RAD):
            break
    return Flight(stable, errors[-1 if stable else 0], *hover(model, data))


def thrusts(model: Model, u: np.ndarray, battery_V: float) -> np.ndarray:
    """Settled thrust of each motor (4, n) [N] at PWM ratios u (n,)."""
    row = np.zeros((len(model.inputs), len(u)))
    row[:4], row[4] = u, battery_V
    row[5:9] = u if len(row) > 5 else row[5:9]
    return settled(model, row, row_hz=model.vehicle.rate_hz)


def hover(model: Model, data: FitWindows) -> tuple[float, float, float]:
    """(PWM the model needs over the mean PWM logged in windows that hover, that mean, their mean voltage V). Uses all
    windows in the air where few hover. Flights count alike, however many of their windows hover.

    The thrust needed is the mass times the measured acceleration against free fall, mean over each window.
    """
    seconds = data.motor.shape[1] / data.row_hz
    gained = (data.truth[:, -1, VELOCITY] - data.start[:, VELOCITY]) / seconds
    lift = model.vehicle.mass_kg * np.linalg.norm(gained + np.array([0.0, 0.0, model.vehicle.gravity_m_s2]), axis=1)
    volts = (data.motor.mean(axis=2) * data.battery_V).mean(axis=1)
    flown = volts > IDLE * np.median(volts)
    ends = (data.start, data.truth[:, -1])
    slow = np.all([np.linalg.norm(state[:, VELOCITY], axis=1) < SLOW_M_S for state in ends]
                  + [np.linalg.norm(state[:, RATE], axis=1) < SLOW_RAD_S for state in ends], axis=0)
    hovers = flown & slow & (np.linalg.norm(gained, axis=1) < STEADY_M_S2)
    used = hovers if hovers.sum() >= FEWEST_WINDOWS else flown
    _, flight, windows = np.unique(data.flight[used], return_inverse=True, return_counts=True)

    def mean(values: np.ndarray) -> float:
        return float(np.average(values[used], weights=1.0 / windows[flight]))

    u = np.linspace(0.0, 1.5, LEVELS)
    battery_V, logged = mean(data.battery_V.mean(axis=1)), mean(data.motor.mean(axis=(1, 2)))
    curve = thrusts(model, u, battery_V).sum(axis=0)
    needed = float(np.interp(mean(lift), np.maximum.accumulate(curve), u))
    return needed / logged, logged, battery_V


def _hold(model: Model, battery_V: float, attitude_gain: float, rate_gain: float) -> tuple[float, float]:
    """(largest distance m, largest tilt rad) at the end, from tilted starts off the point."""
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
    rising = np.maximum.accumulate(curve, axis=1)
    step = numeric.stepper(model)
    turned = np.inf
    with np.errstate(all="ignore"):
        for _ in range(int(SECONDS / row_s)):
            off = np.clip(point - state[:, POSITION], -0.5, 0.5)
            wanted = POSITION_GAIN * off - VELOCITY_GAIN * state[:, VELOCITY]
            wanted[:, 2] += model.vehicle.gravity_m_s2
            body = so3.rotate_inverse(state[:, QUATERNION], wanted)
            lean = np.stack([-body[:, 1], body[:, 0]], axis=1) / np.maximum(body[:, 2:], 1.0)
            moment = inertia[:2] * (attitude_gain * lean - rate_gain * state[:, RATE][:, :2])
            lift = model.vehicle.mass_kg * np.linalg.norm(wanted, axis=1)
            commanded = np.column_stack([lift, moment]) @ mix.T
            u = np.stack([np.interp(commanded[:, i], rising[i], levels) for i in range(4)], axis=1)
            waiting = [*waiting[1:], u]
            row = np.zeros((n, len(model.inputs)))
            row[:, :4], row[:, 4] = waiting[1], battery_V
            if row.shape[1] > 5:
                row[:, 5:9], row[:, 9] = waiting[0], delay
            state = step(state, row)
            if not np.isfinite(state).all():
                return np.inf, np.inf
            up = so3.rotate(state[:, QUATERNION], np.array([0.0, 0.0, 1.0]))
            turned = float(np.arccos(np.clip(up[:, 2].min(), -1.0, 1.0)))
    return float(np.linalg.norm(state[:, POSITION] - point, axis=1).max()), turned

"""Prediction of rotation from commands in various logs, and from measured rotor speed.

The vehicle is a model of physical terms with time constants from measured rotor speed (``lag``). The rest is fitted to
100 ms rollouts of the training flights, separately for every input and in physical ranges. Parameters: moments of
inertia about x and y, the yaw moment, damping, the moment from lateral velocity and a delay. A constant moment about x
and y, which is not logged and changes within tenths of a second, is learned for every window. It follows from the
rates just before the window. Start states, instants and truth (the gyro) are the same for all inputs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from nanobench_tools import so3
from nanobench_tools.physics import Model
from nanobench_tools.physics.fit_bounds import bounds
from nanobench_tools.physics.model import QUATERNION, RATE
from nanobench_tools.physics.rollout import rollout
from nanobench_tools.results import array_fields
from nanobench_tools.settings import count, setting

from .lag import BEFORE_S, Lag
from .radio import COARSE, coarse_rows
from .rotor_rows import Log

FIT_ROWS = count("motors.rotation.fit_rows")
SCORED_ROWS = count("motors.rotation.scored_rows")
MOST_WINDOWS = count("motors.rotation.most_windows")
LOSS_RAD_S = setting("motors.rotation.loss_rad_s")

TRIM_S = setting("motors.rotation.trim_s")

FREE = ("inertia.inertia_kg_m2[0]", "inertia.inertia_kg_m2[1]", "yaw_torque.k_m", "rotor_reaction.J_r", "drag_torque.c",
        "angular_damping.d_r[0]", "angular_damping.d_r[1]", "angular_damping.d_r[2]", "command_delay.delay_s")
START_LAG_S = 0.04
"""Where a fit of own time constants begins: it is to know nothing of the measured speed."""
LAGS = ("motor_lag.tau_up_s", "motor_lag.tau_down_s")
SCALES: Mapping[str, float] = {"inertia": 1e-5, "yaw_torque": 1e-2, "rotor_reaction": 1e-8, "drag_torque": 1e-4,
                               "angular_damping": 1e-5, "command_delay": 1e-2, "motor_lag": 3e-2}
"""Size of a change that matters, by term."""
STEP = 1e-3
"""Step of differences in these sizes."""


@dataclass(frozen=True)
class Input:
    """One kind of input. ``source``: ``motor`` or ``rpm`` at the rows of the log, else a key of radio.COARSE.
    ``own_lag``: time constants are fitted instead of taken from the rotor speeds."""

    name: str
    words: str
    source: str
    own_lag: bool = False


STILL = Input("still", "no input: the body's rates stand still", "")
INPUTS = (
    Input("radio", "PWM of a radio stream: 100 Hz, 23 % lost, straight lines between packets", "radio"),
    Input("radio_own_lag", "the same, time constants fitted to it", "radio", True),
    Input("sampled_100", "PWM sampled at 100 Hz, nothing lost", "sampled"),
    Input("averaged_100", "PWM averaged over 10 ms", "averaged"),
    Input("logged", "PWM at every row of the log", "motor"),
    Input("logged_own_lag", "the same, time constants fitted to it", "motor", True),
    Input("rpm", "measured rotor speed at every row of the log", "rpm"))


@dataclass(frozen=True)
class Batch:
    """n windows of one input.

    - motor (n, P + H, 4) and battery_V (n, P + H): with P rows before the window.
    - start and earlier (n, 13): states at its start and TRIM_S before it.
    - rate (n, K + 50, 3) and quaternion (n, 50, 4): truth at rows of 10 ms. K of them are before the start and 50
    after.
    - every: rows of input per 10 ms.
    - flight (n,).
    """

    motor: np.ndarray
    battery_V: np.ndarray
    start: np.ndarray
    earlier: np.ndarray
    rate: np.ndarray
    quaternion: np.ndarray
    flight: np.ndarray
    row_hz: float
    every: int
    before: int

    def cut(self, rows: int) -> Batch:
        """Without the input after ``rows`` rows of 10 ms."""
        end = self.before + rows * self.every
        return replace(self, motor=self.motor[:, :end], battery_V=self.battery_V[:, :end])

    def part(self, keep: np.ndarray) -> Batch:
        """Some windows."""
        return array_fields.rows(self, keep)

    def repeated(self, times: int) -> Batch:
        """All windows ``times`` after one another."""
        return array_fields.joined([self] * times)

    @property
    def step_s(self) -> float:
        """Length of a row of 10 ms."""
        return self.every / self.row_hz

    @property
    def trim_rows(self) -> int:
        return int(self.rate.shape[1] - SCORED_ROWS)

    @property
    def later(self) -> np.ndarray:
        """(n, 50, 3) rates after the start."""
        return self.rate[:, -SCORED_ROWS:]


def batch(logs: Sequence[Log], kind: Input, seed: int = 0) -> Batch | None:
    """Windows that start every 100 ms of all flying rows with room before and for 0.5 s after; None without any."""
    row_s = logs[0].row_s
    step = coarse_rows(row_s)
    fine = kind.source in ("motor", "rpm")
    trim, warm = (round(x / row_s / step) for x in (TRIM_S, BEFORE_S))
    parts: list[tuple[np.ndarray, ...]] = []
    for number, log in enumerate(logs):
        if log.state is None:
            continue
        first = log.windows((SCORED_ROWS + 1) * step, FIT_ROWS * step, (warm + trim) * step)
        rows_of = first[:, None] + np.arange(-(warm + trim) * step, SCORED_ROWS * step, 1 if fine else step)
        if fine:
            motor = (log.speed if kind.source == "rpm" else log.u)[rows_of]
        else:
            rng = np.random.default_rng([seed, number])
            motor = COARSE[kind.source](log, rows_of.ravel(), rng).reshape(*rows_of.shape, 4)
        states = np.concatenate([log.state, log.rate], axis=1)
        truth = first[:, None] + step * np.arange(1 - trim, SCORED_ROWS + 1)
        parts.append((motor, log.battery_V[rows_of], states[first], states[first - trim * step], log.rate[truth],
                      log.state[truth[:, trim:], 6:10], np.full(len(first), number)))
    if not sum(len(part[-1]) for part in parts):
        return None
    every = step if fine else 1
    inputs, battery_V, start, earlier, rate, quaternion, flight = map(np.concatenate, zip(*parts, strict=True))
    return Batch(inputs, battery_V, start, earlier, rate, quaternion, flight, every / (row_s * step), every,
                 (warm + trim) * every)


def rotation_model(lag: Lag, kind: Input, inertia: Sequence[float], row_s: float) -> Model:
    """The terms of one input, in rows of ``row_s``, at the start values of a fit. Thrust map, vehicle and k_f are those
    of the lag."""
    base = lag.model
    if kind.source == "rpm":
        # a measured speed is followed within a row: a jump would have no acceleration
        model = Model(replace(base.vehicle, input="rpm"), {"thrust_rpm": base.values_of("thrust_rpm"),
                                                           "motor_lag": {"tau_up_s": row_s, "tau_down_s": row_s}})
    else:
        up, down = (START_LAG_S,) * 2 if kind.own_lag else (lag.tau_up_s, lag.tau_down_s)
        model = base.with_term("motor_lag", tau_up_s=up, tau_down_s=down)
    return (model.with_term("inertia", inertia_kg_m2=tuple(inertia)).with_term("yaw_torque", k_m=0.006)
            .with_term("rotor_reaction", J_r=2e-8)
            .with_term("drag_torque", c=-1e-4).with_term("com_offset", r_m=(0.0, 0.0, 0.0))
            .with_term("angular_damping", d_r=(1e-6, 1e-6, 1e-6)).with_term("command_delay", delay_s=0.005))


@dataclass(frozen=True)
class Rotation:
    """A fitted model and why it is no result (empty if it is one)."""

    model: Model
    free: tuple[str, ...]
    trouble: str = ""


def _rollout(model: Model, data: Batch, start: np.ndarray, first: int, end: int, parameters: np.ndarray) -> np.ndarray:
    """(n, rows of 10 ms, 17) from ``start`` over rows first..end of the input, warmed up on those before."""
    past = data.motor[:, :first], data.battery_V[:, :first]
    states = rollout(model, start, data.motor[:, first:end], data.battery_V[:, first:end], past, row_hz=data.row_hz,
                     parameters=parameters)
    return states[:, data.every::data.every]


def trimmed(model: Model, data: Batch, values: np.ndarray) -> np.ndarray:
    """Parameters (n, P) with the centre of mass of every window where the rates before it say.

    The rollout over TRIM_S misses the measured rates by a slope, the angular acceleration of a constant moment.
    """
    rows = data.trim_rows
    states = _rollout(model, data, data.earlier, data.before - rows * data.every, data.before, values)
    time_s = data.step_s * np.arange(1, rows + 1)
    slope = np.einsum("nhk,h->nk", data.rate[:, :rows] - states[..., RATE], time_s) / np.sum(time_s**2)
    found = values.copy()
    weight = model.vehicle.mass_kg * model.vehicle.gravity_m_s2
    x, y = (model.index(f"com_offset.r_m[{i}]") for i in (0, 1))
    jx, jy = (values[:, model.index(f"inertia.inertia_kg_m2[{i}]")] for i in (0, 1))
    found[:, x] += jy * slope[:, 1] / weight  # -r x (weight e3) = (-r_y, r_x, 0) weight
    found[:, y] -= jx * slope[:, 0] / weight
    return found


def predict(model: Model, data: Batch, parameters: np.ndarray | None = None, rows: int = SCORED_ROWS) -> np.ndarray:
    """States (n, rows, 17) after 1, 2 ... rows of 10 ms; parameters (n, P), by default the model's."""
    values = np.tile(model.values, (len(data.start), 1)) if parameters is None else parameters
    values = trimmed(model, data, values)
    return _rollout(model, data, data.start, data.before, data.before + rows * data.every, values)


def fit_rotation(model: Model, data: Batch, own_lag: bool = False) -> Rotation:
    """Free parameters from rates over 100 ms; every window's rates count alike, with a soft L1 loss."""
    data = data.part(np.arange(0, len(data.start), max(-(-len(data.start) // MOST_WINDOWS), 1))).cut(FIT_ROWS)
    free = FREE + (LAGS if own_lag else ())
    index = np.array([model.index(name) for name in free])
    size = np.array([SCALES[name.partition(".")[0]] for name in free])
    low, high = (bound[index] / size for bound in bounds(model))
    truth, n = data.later[:, :FIT_ROWS], len(data.start)

    def rates(points: np.ndarray) -> np.ndarray:
        many = np.tile(model.values, (len(points) * n, 1))
        many[:, index] = np.repeat(points * size, n, axis=0)
        found = predict(model, data.repeated(len(points)), many, FIT_ROWS)
        return found[..., RATE].reshape(len(points), n, FIT_ROWS, 3)

    def residuals(point: np.ndarray) -> np.ndarray:
        return np.asarray((rates(point[None])[0] - truth).ravel())

    def jacobian(point: np.ndarray) -> np.ndarray:
        found = rates(np.vstack([point, point + STEP * np.eye(len(point))])).reshape(1 + len(point), -1)
        return np.asarray((found[1:] - found[0]).T / STEP)

    start = np.clip(model.values[index] / size, low + 1e-6, high - 1e-6)
    found = least_squares(residuals, start, jacobian, bounds=(low, high), loss="soft_l1", f_scale=LOSS_RAD_S,
                          xtol=1e-4, ftol=1e-4, max_nfev=60)
    values = model.values.copy()
    values[index] = found.x * size
    stuck = [name for name, x, a, b in zip(free, found.x, low, high, strict=True)
             if x > b - 1e-3 * (b - a) or (name in LAGS and x < a + 1e-3 * (b - a))]
    trouble = "" if found.success else "did not converge"
    return Rotation(model.with_values(values), free, f"{stuck[0]} sits on its bound" if stuck else trouble)


def errors(fitted: Rotation | None, data: Batch) -> dict[str, np.ndarray]:
    """Errors after 1..50 rows of 10 ms, (n, 50): rate rad/s (norm), roll_pitch and yaw rate, attitude rad. Without a
    model: errors of a vehicle with constant rates."""
    if fitted is None:
        rate = np.repeat(data.start[:, None, RATE], SCORED_ROWS, axis=1)
        time_s = data.step_s * np.arange(1, SCORED_ROWS + 1)
        turned = so3.exp(data.start[:, None, RATE] * time_s[:, None])
        quaternion = so3.multiply(np.repeat(data.start[:, None, QUATERNION], SCORED_ROWS, axis=1), turned)
    else:
        states = predict(fitted.model, data)
        rate, quaternion = states[..., RATE], states[..., QUATERNION]
    off = rate - data.later
    return {"rate": np.linalg.norm(off, axis=2), "roll_pitch": np.linalg.norm(off[..., :2], axis=2),
            "yaw": np.abs(off[..., 2]), "attitude": so3.geodesic_angle(data.quaternion, quaternion)}

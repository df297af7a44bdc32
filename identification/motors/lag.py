"""How fast rotors follow their command: time constants up and down, fitted by simulation against measured speed.

The command goes through the physics of the simulator, one second at a time. Its terms are thrust_voltage of degree 1,
motor_lag, command_delay and thrust_rpm. The simulated speed is compared with the measured one. Both are taken
without their mean over the window and with one gain per motor. Neither a sagging battery nor a warming motor then
looks like a lag. With a straight map such a gain changes no other parameter. A soft L1 loss bounds what single rows
with a wrong speed can do. The delay holds what is pure waiting: of the command, and of the speed measurement (half a
revolution and more).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from nanobench_tools.metrics.statistics import Labels, weights
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.inputs import rows, settled
from nanobench_tools.physics.ops import NUMPY
from nanobench_tools.physics.rollout import compiled_lagged
from nanobench_tools.physics.term import Situation, Stage
from nanobench_tools.physics.terms.thrust_rpm import TERM as THRUST_RPM
from nanobench_tools.settings import setting

from .rotor_rows import Log

WINDOW_S = setting("motors.lag.window_s")
BEFORE_S = setting("motors.lag.before_s")

UP, DOWN, DELAY = "motor_lag.tau_up_s", "motor_lag.tau_down_s", "command_delay.delay_s"
LOWER, UPPER = 0.001, 0.25
STEP_S = 2e-4
"""Step of the differences that give derivatives; a tenth of a row."""

CANDIDATES: Mapping[str, tuple[str, ...]] = {
    "at once": (), "delay": ("delay",), "one lag + delay": ("tau", "delay"),
    "up and down + delay": ("up", "down", "delay")}
"""Fitted parameters, the simplest first; the rest is zero, or the same up and down."""

NO_WORSE = setting("motors.lag.no_worse")


@dataclass(frozen=True)
class Windows:
    """n windows of H rows: u (n, H, 4) and battery_V (n, H), the same before, speed (n, H, 4) rad/s, flight (n,)."""

    u: np.ndarray
    battery_V: np.ndarray
    past_u: np.ndarray
    past_V: np.ndarray
    speed: np.ndarray
    flight: np.ndarray


def windows_of(logs: Sequence[Log]) -> Windows:
    """Windows laid end to end over all flying rows."""
    parts: list[tuple[Any, ...]] = []
    for number, log in enumerate(logs):
        length, before = round(WINDOW_S / log.row_s), round(BEFORE_S / log.row_s)
        for first in log.windows(length, length, before):
            now, past = slice(first, first + length), slice(first - before, first)
            parts.append((log.u[now], log.battery_V[now], log.u[past], log.battery_V[past],
                          log.speed[now], number))
    columns = [np.stack(c) for c in zip(*parts, strict=True)] if parts else []
    if not columns:
        return Windows(*(np.empty((0, 1, 4)), np.empty((0, 1))) * 2, np.empty((0, 1, 4)), np.empty(0, int))
    return Windows(*columns)


@dataclass(frozen=True)
class Lag:
    """tau_up_s, tau_down_s, delay_s; ``rms_rad_s``: of measured minus simulated speed about the windows' means;
    ``model``: with the map it was simulated with; ``gain`` (4,): measured over simulated change of speed, per motor;
    ``trouble``: why it is no result. ``gradient`` (F, K), curvature (F, K, K) of the flights at the solution, for
    intervals."""

    name: str
    model: Model
    tau_up_s: float
    tau_down_s: float
    delay_s: float
    rms_rad_s: float
    gain: np.ndarray
    trouble: str = ""
    gradient: np.ndarray | None = None
    curvature: np.ndarray | None = None

    @property
    def values(self) -> tuple[float, float, float]:
        return self.tau_up_s, self.tau_down_s, self.delay_s


def hover_model(logs: Sequence[Log], k_f: float, mass_kg: float) -> Model:
    """Thrust in a straight line of motor voltage through the means of these flights; its slope is only a start."""
    mean_V = float(np.mean(np.concatenate([log.joined(log.u * log.battery_V[:, None]) for log in logs])))
    mean_N = k_f * float(np.mean(np.concatenate([log.joined(log.speed**2) for log in logs])))
    vehicle = Vehicle(mass_kg=mass_kg, rate_hz=1.0 / logs[0].row_s)
    return Model(vehicle, {"thrust_voltage": {"c": (-mean_N, 2.0 * mean_N / mean_V)}, "thrust_rpm": {"k_f": k_f}})


def steeper(model: Model, factor: float, at_V: float) -> Model:
    """The straight map with its slope changed by ``factor`` and its thrust at the motor voltage ``at_V`` kept."""
    c = model.values_of("thrust_voltage")["c"]
    return model.with_term("thrust_voltage", c=(c[0] + (1.0 - factor) * c[1] * at_V, factor * c[1]))


def lag_model(model: Model, values: Sequence[float]) -> Model:
    """A model with thrust map and thrust_rpm, with lag and delay at ``values`` (up, down, delay)."""
    up, down, delay = values
    return model.with_term("motor_lag", tau_up_s=up, tau_down_s=down).with_term("command_delay", delay_s=delay)


def simulate(model: Model, data: Windows, values: np.ndarray, row_s: float) -> np.ndarray:
    """Rotor speeds (m, n, H, 4) rad/s at m sets of (up, down, delay) (m, 3), at the same rows as the measured ones."""
    m, n = len(values), len(data.u)
    model = lag_model(model, values[0])
    parameters = np.repeat(np.tile(model.values, (m, 1)), n, axis=0)
    for k, name in enumerate((UP, DOWN, DELAY)):
        parameters[:, model.index(name)] = np.repeat(values[:, k], n)
    many = [np.tile(x, (m, *(1,) * (x.ndim - 1))) for x in (data.u, data.battery_V, data.past_u, data.past_V)]
    row_hz = 1.0 / row_s
    window, before = rows(model, many[0], many[1], (many[2], many[3]), row_hz=row_hz, parameters=parameters)
    follow = compiled_lagged(model, row_hz, own_parameters=True)
    thrust = settled(model, before[0], row_hz=row_hz, parameters=parameters)
    thrust = follow(thrust, before, parameters.T, keep="last")[0]
    # the state after row j is the one at the time of row j + 1
    found = follow(thrust, window[:-1], parameters.T)[0]
    p = SimpleNamespace(k_f=model.values_of("thrust_rpm")["k_f"])
    at = Situation(model.vehicle, row_s)
    speed = THRUST_RPM.acts[Stage.ROTOR_SPEED](list(found.transpose(1, 0, 2)), p, at, NUMPY)
    return np.stack(speed, axis=-1).transpose(1, 0, 2).reshape(m, n, -1, 4)


def centred(speed: np.ndarray) -> np.ndarray:
    """(..., H, 4) without the mean over the window."""
    return np.asarray(speed - speed.mean(axis=-2, keepdims=True))


def gains(simulated: np.ndarray, measured: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(m, 4) measured over simulated, by least squares over all windows; centred (m, n, H, 4) and (n, H, 4)."""
    top = np.einsum("mnhk,nhk,n->mk", simulated, measured, weights)
    return np.asarray(top / np.einsum("mnhk,mnhk,n->mk", simulated, simulated, weights))


def part_of(data: Windows, keep: np.ndarray) -> Windows:
    """Some windows."""
    return Windows(*(x[keep] for x in (data.u, data.battery_V, data.past_u, data.past_V, data.speed, data.flight)))


def fit_lag(model: Model, data: Windows, row_s: float, name: str = "up and down + delay",
            keep: np.ndarray | None = None) -> Lag:
    """One candidate fitted to the windows of the flights ``keep`` (all by default).

    Twice: speed is the root of thrust, so a gain of speed is a slope of the map for small changes only. After the
    first fit the map has that slope and the remaining gain is near 1.
    """
    used = data if keep is None else part_of(data, np.isin(data.flight, keep))
    found = _fit(model, used, row_s, name, None)
    if "tau" not in CANDIDATES[name] and "up" not in CANDIDATES[name]:
        return found
    at_V = float(np.mean(used.u * used.battery_V[..., None]))
    return _fit(steeper(model, float(np.mean(found.gain)), at_V), used, row_s, name, found)


def _fit(model: Model, used: Windows, row_s: float, name: str, first: Lag | None) -> Lag:
    wanted = CANDIDATES[name]
    measured, one = centred(used.speed), np.ones(len(used.u))

    def full(free: np.ndarray) -> np.ndarray:
        at = dict(zip(wanted, free, strict=True))
        return np.array([at.get("up", at.get("tau", 0.0)), at.get("down", at.get("tau", 0.0)), at.get("delay", 0.0)])

    def residuals(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = centred(simulate(model, used, np.array([full(p) for p in points]), row_s))
        gain = gains(found, measured, one)
        return measured - gain[:, None, None] * found, gain

    def jacobian(free: np.ndarray) -> np.ndarray:
        left = residuals(np.vstack([free, free + STEP_S * np.eye(len(free))]))[0].reshape(1 + len(free), -1)
        return np.asarray((left[1:] - left[0]).T / STEP_S)

    low = np.array([0.0 if w == "delay" else LOWER for w in wanted])
    start = np.array([0.004 if w == "delay" else 0.035 for w in wanted])
    if first is not None:
        last = {"up": first.tau_up_s, "tau": first.tau_up_s, "down": first.tau_down_s, "delay": first.delay_s}
        start = np.clip([last[w] for w in wanted], low + 1e-6, UPPER - 1e-6)
    left, gain = residuals(start[None])
    if not wanted:
        return Lag(name, model, 0.0, 0.0, 0.0, float(np.sqrt(np.mean(left[0] ** 2))), gain[0])
    spread = 1.4826 * float(np.median(np.abs(left)))
    found = least_squares(lambda p: residuals(p[None])[0].ravel(), start, jacobian, bounds=(low, UPPER),
                          loss="soft_l1", f_scale=spread, x_scale=0.01, xtol=1e-5, ftol=1e-6, max_nfev=40)
    left, gain = residuals(found.x[None])
    at_bound = [w for w, x, lo in zip(wanted, found.x, low, strict=True)
                if x > UPPER - 1e-4 or (w != "delay" and x < lo + 1e-4)]
    trouble = f"{at_bound[0]} sits on its bound" if at_bound else "" if found.success else "did not converge"
    robust = 1.0 / np.sqrt(1.0 + (left[0] / spread) ** 2)
    slopes = jacobian(found.x).reshape(*left[0].shape, len(wanted))
    gradient, curvature = [], []
    for flight in np.unique(used.flight):
        of = used.flight == flight
        weighted = slopes[of] * robust[of][..., None]
        gradient.append(np.einsum("nhkp,nhk->p", weighted, left[0][of]))
        curvature.append(np.einsum("nhkp,nhkq->pq", weighted, slopes[of]))
    up, down, delay = (float(x) for x in full(found.x))
    return Lag(name, model, up, down, delay, float(np.sqrt(np.mean(left[0] ** 2))), gain[0], trouble,
               np.array(gradient), np.array(curvature))


def held_out_rms(lag: Lag, data: Windows, row_s: float, flights: Sequence[int]) -> np.ndarray:
    """(len(flights),) RMS [rad/s] of a fitted candidate on flights, its gains included."""
    found = []
    for flight in flights:
        part = part_of(data, data.flight == flight)
        speed = centred(simulate(lag.model, part, np.array([lag.values]), row_s))[0]
        found.append(float(np.sqrt(np.mean((centred(part.speed) - lag.gain * speed) ** 2))))
    return np.array(found)


def intervals(lag: Lag, draws: int = 1000, seed: int = 0, sessions: Labels = None) -> dict[str, list[float]]:
    """95 % intervals by drawing sessions and flights: one Gauss-Newton step per draw from the solution. Empty for one
    flight or session."""
    if lag.gradient is None or lag.curvature is None:
        return {}
    drawn = weights(len(lag.gradient), sessions, seed, draws)
    if drawn is None:
        return {}
    step = -np.linalg.solve(np.tensordot(drawn, lag.curvature, 1), np.tensordot(drawn, lag.gradient, 1)[..., None])
    wanted = CANDIDATES[lag.name]
    low, high = np.percentile(step[..., 0], [2.5, 97.5], axis=0)
    value = {"up": lag.tau_up_s, "tau": lag.tau_up_s, "down": lag.tau_down_s, "delay": lag.delay_s}
    return {w: [max(value[w] + float(a), 0.0), value[w] + float(b)] for w, a, b in zip(wanted, low, high, strict=True)}

"""The batch smoother with two laws of a quadrotor: drag as velocity, thrust as a vertical accelerometer.

The accelerometer's x and y measure drag alone. Their mean over each state is offset - k v - q |v| v in the body. Its z
measures thrust: scale times the firmware's curve of PWM times battery voltage. Offset, drag coefficient, thrust scale
and the drift of the vertical accelerometer's bias are slow quantities, learned while poses come. The states continue
after the last pose to the touch-down. A value in a blackout therefore also uses the IMU, motors and battery of the time
after it (never a later pose).

References
----------
Leishman et al. 2014, "Quadrotors and accelerometers: State estimation with an improved dynamic model", IEEE Control
Systems 34(1).
"""

import warnings
from collections.abc import Callable, Iterable

import numpy as np

from nanobench_tools.flight import Flight
from nanobench_tools.physics.terms.thrust_voltage import TERM
from nanobench_tools.physics.vehicle import Vehicle
from nanobench_tools.settings import number
from nanobench_tools.units import GRAVITY_M_S2

from ..drag_ekf import TUNED
from .batch import GtsamBatch, Poses
from .factor_graph import Linear, Problem
from .smoother_rows import Rows
from .state_path import Path, State

DRAG_1_S = number("estimators.aided_batch.drag_1_s")
DRAG_SD_1_S = number("estimators.aided_batch.drag_sd_1_s")
DRAG_WALK = number("estimators.aided_batch.drag_walk")
DRAG_QUADRATIC_1_M = number("estimators.aided_batch.drag_quadratic_1_m")
"""Drag over mass of a 40 g Crazyflie, with hardly any freedom per flight. With 0.03 1/s the fit confuses tilt with
drag, which costs height after 20 s of fast flight (circles and trefoils)."""

OFFSET_SD_M_S2 = number("estimators.aided_batch.offset_sd_m_s2")
OFFSET_WALK = number("estimators.aided_batch.offset_walk")
WARMS_SD_M_S3, WARMS_WALK = TUNED["slope_sd"], 1e-6
"""By how much the drift of the vertical bias is another in each flight than in all; next to no change within one."""

SCALE = number("estimators.aided_batch.scale")
SCALE_SD = number("estimators.aided_batch.scale_sd")
SCALE_WALK = number("estimators.aided_batch.scale_walk")
"""Thrust against the firmware's curve; it changes from flight to flight, and within one."""

DRAG_NOISE_M_S2 = number("estimators.aided_batch.drag_noise_m_s2")
THRUST_NOISE_M_S2 = number("estimators.aided_batch.thrust_noise_m_s2")
"""Noise of a mean over one state: wake and gusts. Thrust has little weight: its error is correlated over seconds.
Treated as white noise of 0.3 m/s^2 it made the height after 10 s worse on circles and trefoils."""

ODD = number("estimators.aided_batch.odd")

LAG_S = number("estimators.aided_batch.lag_s")

FLYING = number("estimators.aided_batch.flying")


STRUCK_M_S2 = number("estimators.aided_batch.struck_m_s2")
LANDING_S = number("estimators.aided_batch.landing_s")
"""Time for which vehicles bounce and slide on with running motors after a touch-down. A touch-down is a specific force
at the end of a flight that rotors with a thrust of 1.25 times the weight cannot make."""


class GtsamAided(GtsamBatch):
    """Batch smoother of poses, IMU, drag and thrust; it looks ahead.

    Without motors or battery it reports this and uses drag alone. Parameters and attributes are those of
    ``gtsam_batch``.
    """

    name = "gtsam_aided"
    warms = 9
    slow = np.append(GtsamBatch.slow, [0.0, 0.0, DRAG_1_S, SCALE, 0.0])
    slow_sd = np.append(GtsamBatch.slow_sd, [OFFSET_SD_M_S2, OFFSET_SD_M_S2, DRAG_SD_1_S, SCALE_SD, WARMS_SD_M_S3])
    walk = np.append(GtsamBatch.walk, [OFFSET_WALK, OFFSET_WALK, DRAG_WALK, SCALE_WALK, WARMS_WALK])

    def measured_until(self, flight: Flight, rows: Rows, time_s: np.ndarray) -> float:
        """To the last state in flight, or to the touch-down: after it legs push, and no law here holds."""
        thrust = _thrust(flight, time_s)
        flown = time_s if thrust is None else time_s[thrust > FLYING * GRAVITY_M_S2]
        end_s = float(flown[-1]) if len(flown) else -np.inf
        struck = rows.time_s[np.linalg.norm(rows.acc, axis=1) > STRUCK_M_S2]
        struck = struck[(struck > end_s - LANDING_S) & (struck < end_s)]
        if len(struck):
            end_s = float(time_s[max(np.searchsorted(time_s, struck[0]) - 1, 0)])
        return max(end_s, float(rows.pose_s[-1]))

    def blocks(self, flight: Flight, problem: Problem, start: State) -> Callable[[State, Path], Iterable[Linear]]:
        poses = Poses(problem, start)
        force = _means(problem)
        thrust = _thrust(flight, problem.time_s)
        if thrust is None:
            warnings.warn(f"{problem.rows.place}: gtsam_aided goes on without thrust, which needs the "
                          f"{' and '.join(_missing(flight))} stream", stacklevel=2)
        flying = np.arange(problem.count) if thrust is None else np.flatnonzero(thrust > FLYING * GRAVITY_M_S2)

        def at(state: State, path: Path) -> Iterable[Linear]:
            yield poses.linear(state, path)
            if len(flying):
                yield drag(state, force, flying)
                if thrust is not None:
                    yield lift(state, force, thrust, flying)

        return at


def drag(state: State, force: np.ndarray, index: np.ndarray) -> Linear:
    """Mean specific force x, y (K, 3) of the states ``index``: offset - k v - q |v| v."""
    rotation, c = state.rotation[index], state.slow[index]
    back = np.swapaxes(rotation, 1, 2)
    body = np.einsum("nij,nj->ni", back, state.velocity[index])
    quadratic = DRAG_QUADRATIC_1_M * np.abs(body[:, :2])
    residual = force[index, :2] - c[:, 5:7] + (c[:, 7:8] + quadratic) * body[:, :2]
    slope = (c[:, 7:8] + 2.0 * quadratic)[:, :, None]
    n = len(index)
    by_x, by_c = np.zeros((n, 2, 6)), np.zeros((n, 2, c.shape[1]))
    x, y, z = body.T
    o = np.zeros(n)
    turned = np.stack([np.stack([o, -z, y], 1), np.stack([z, o, -x], 1)], 1)  # of the body velocity by a small turn
    by_x[:, :, :3] = -slope * turned
    by_c[:, 0, 5] = by_c[:, 1, 6] = 1.0
    by_c[:, :, 7] = -body[:, :2]
    off = np.linalg.norm(residual, axis=1) / DRAG_NOISE_M_S2
    sigma = DRAG_NOISE_M_S2 * np.sqrt(np.maximum(off / ODD, 1.0))
    keys = [("x", index, by_x), ("v", index, -slope * back[:, :2]), ("c", index, by_c)]
    return Linear(keys, residual, np.column_stack([sigma, sigma]))


def lift(state: State, force: np.ndarray, thrust: np.ndarray, index: np.ndarray) -> Linear:
    """Mean specific force z of the states ``index``: bias + scale x thrust over mass [m/s^2]."""
    c = state.slow[index]
    residual = force[index, 2] - state.acc_bias[index, 2] - c[:, 8] * thrust[index]
    n = len(index)
    by_b, by_c = np.zeros((n, 1, 6)), np.zeros((n, 1, c.shape[1]))
    by_b[:, 0, 2], by_c[:, 0, 8] = 1.0, thrust[index]
    return Linear([("b", index, by_b), ("c", index, by_c)], residual[:, None], np.array([THRUST_NOISE_M_S2]))


def _edges(time_s: np.ndarray) -> np.ndarray:
    """(K + 1,) bounds of the time that belongs to each of K states."""
    middle = 0.5 * (time_s[1:] + time_s[:-1])
    return np.concatenate([time_s[:1], middle, time_s[-1:]])


def _mean_between(time_s: np.ndarray, values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(K, d) means of piecewise linear ``values`` (n, d) between ``edges`` (K + 1,)."""
    step = np.diff(time_s)[:, None]
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(0.5 * (values[1:] + values[:-1]) * step, axis=0)])
    at = np.stack([np.interp(edges, time_s, column) for column in total.T], axis=1)
    return np.diff(at, axis=0) / np.diff(edges)[:, None]


def _means(problem: Problem) -> np.ndarray:
    return _mean_between(problem.rows.time_s, problem.rows.acc, _edges(problem.time_s))


def _missing(flight: Flight) -> list[str]:
    return [name for name in ("motor", "battery") if name not in flight or len(flight[name]) < 2]


def _thrust(flight: Flight, at_s: np.ndarray) -> np.ndarray | None:
    """(K,) thrust over mass [m/s^2] by the firmware's curve, of states at K times; None without motors or battery."""
    if _missing(flight):
        return None
    motor, battery = flight["motor"], flight["battery"]
    good = np.isfinite(motor.values).all(axis=1)
    u, time_s = motor["m1", "m2", "m3", "m4"][good], motor.time_s[good]
    volt = np.interp(time_s, battery.time_s, battery["vbat"])
    total = np.polynomial.polynomial.polyval(u * volt[:, None], TERM.parameters[0].typical).sum(axis=1)
    total = np.where(u.max(axis=1) > 0.0, total, 0.0) / Vehicle().mass_kg
    return _mean_between(time_s + LAG_S, total[:, None], _edges(at_s))[:, 0]

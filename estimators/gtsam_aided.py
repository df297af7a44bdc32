"""The batch smoother with what a quadrotor's own physics says: drag as velocity, thrust as a vertical accelerometer.

The accelerometer's x and y feel drag alone (Leishman et al., IEEE Control Systems 2014): their mean over each state is
offset - k v in the body. Its z feels thrust: scale times the firmware's curve of PWM times battery voltage. Offset,
drag coefficient and thrust scale are slow quantities, learned while poses come. The states go on after the last pose,
so that a value in a blackout uses the IMU, motors and battery of the time after it too (never a later pose).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable

import numpy as np

from nanobench_tools.flight import Flight
from nanobench_tools.physics.terms.thrust_voltage import TERM
from nanobench_tools.physics.vehicle import Vehicle
from nanobench_tools.units import GRAVITY_M_S2

from .gtsam_batch import GtsamBatch, Poses
from .gtsam_graph import Linear, Problem
from .gtsam_path import Path, State

DRAG_1_S, DRAG_SD_1_S = 0.40, 0.03
"""Linear drag of a 40 g Crazyflie over its mass."""

OFFSET_SD_M_S2, OFFSET_WALK = 0.1, 0.002
SCALE, SCALE_SD, SCALE_WALK = 0.94, 0.05, 0.005
"""Thrust against the firmware's curve; it changes from flight to flight, and within one."""

DRAG_NOISE_M_S2, THRUST_NOISE_M_S2 = 0.09, 3.0
"""Of a mean over one state: wake and gusts. Thrust counts little: its error hangs together over seconds, and taken for
white of 0.3 m/s^2 it made the height after 10 s worse on circles and trefoils."""

LAG_S = 0.06
"""From a PWM to its thrust."""

FLYING = 0.5
"""Share of the weight that the thrust must carry for these laws to hold: not on the ground."""


class GtsamAided(GtsamBatch):
    """Batch smoother of poses, IMU, drag and thrust. Without motors or battery it says so and goes on with drag."""

    name = "gtsam_aided"
    measures_after_poses = True
    slow = np.append(GtsamBatch.slow, [0.0, 0.0, DRAG_1_S, SCALE])
    slow_sd = np.append(GtsamBatch.slow_sd, [OFFSET_SD_M_S2, OFFSET_SD_M_S2, DRAG_SD_1_S, SCALE_SD])
    walk = np.append(GtsamBatch.walk, [OFFSET_WALK, OFFSET_WALK, 1e-3, SCALE_WALK])

    def blocks(self, flight: Flight, problem: Problem):
        poses = Poses(problem)
        force = _means(problem)
        thrust = _thrust(flight, problem)
        flying = np.arange(problem.count) if thrust is None else np.flatnonzero(thrust > FLYING * GRAVITY_M_S2)

        def at(state: State, path: Path) -> Iterable[Linear]:
            yield poses.linear(state, path)
            if len(flying):
                yield drag(state, force, flying)
                if thrust is not None:
                    yield lift(state, force, thrust, flying)

        return at


def drag(state: State, force: np.ndarray, index: np.ndarray) -> Linear:
    """Mean specific force x, y (K, 3) of the states ``index``: offset - k v."""
    rotation, c = state.rotation[index], state.slow[index]
    back = np.swapaxes(rotation, 1, 2)
    body = np.einsum("nij,nj->ni", back, state.velocity[index])
    k = c[:, 7]
    residual = force[index, :2] - c[:, 5:7] + k[:, None] * body[:, :2]
    n = len(index)
    by_x, by_v, by_c = np.zeros((n, 2, 6)), np.zeros((n, 2, 3)), np.zeros((n, 2, c.shape[1]))
    x, y, z = body.T
    o = np.zeros(n)
    turned = np.stack([np.stack([o, -z, y], 1), np.stack([z, o, -x], 1)], 1)  # of the body velocity by a small turn
    by_x[:, :, :3] = -k[:, None, None] * turned
    by_v[:] = -k[:, None, None] * back[:, :2]
    by_c[:, 0, 5] = by_c[:, 1, 6] = 1.0
    by_c[:, :, 7] = -body[:, :2]
    return Linear([("x", index, by_x), ("v", index, by_v), ("c", index, by_c)], residual, np.full(2, DRAG_NOISE_M_S2))


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


def _thrust(flight: Flight, problem: Problem) -> np.ndarray | None:
    """(K,) thrust over mass [m/s^2] by the firmware's curve; None, and a warning, without motors or battery."""
    missing = [name for name in ("motor", "battery") if name not in flight or len(flight[name]) < 2]
    if missing:
        warnings.warn(f"{problem.rows.place}: gtsam_aided goes on without thrust, which needs the "
                      f"{' and '.join(missing)} stream", stacklevel=2)
        return None
    motor, battery = flight["motor"], flight["battery"]
    good = np.isfinite(motor.values).all(axis=1)
    u, time_s = motor["m1", "m2", "m3", "m4"][good], motor.time_s[good]
    volt = np.interp(time_s, battery.time_s, battery["vbat"])
    total = np.polynomial.polynomial.polyval(u * volt[:, None], TERM.parameters[0].typical).sum(axis=1)
    total = np.where(u.max(axis=1) > 0.0, total, 0.0) / Vehicle().mass_kg
    return _mean_between(time_s + LAG_S, total[:, None], _edges(problem.time_s))[:, 0]

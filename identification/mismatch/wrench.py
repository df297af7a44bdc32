"""The residual wrench: force and moment as measured, compared with those of a simulator along the measured states.

The measured pose, velocity and rate go into the model's equations, and only the rotors are integrated. So an error
shows where and when it acts and does not accumulate. Measured and predicted values pass the same filter. Positions get
a smoothed second derivative and accelerations the same smoothing (a Gaussian commutes with the derivative). Rates get a
difference, and angular accelerations their mean over the same stretch:

    g'' * p - g * a_model  [m/s^2]          (w(t + h) - w(t)) / h - mean of alpha_model over h  [rad/s^2]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.ndimage import convolve1d
from scipy.signal import lfilter

from nanobench_tools import so3
from nanobench_tools.physics import Model
from nanobench_tools.physics.inputs import rows
from nanobench_tools.physics.numeric import equations
from nanobench_tools.physics.rollout import compiled_lagged
from nanobench_tools.physics.term import Stage
from nanobench_tools.settings import count, number

from .commanded import UNASKED, WHY, WHY_STILL
from .track import ROW_S, Track, joined

SMOOTH_S = number("mismatch.wrench.smooth_s")
FORCE_ROWS = count("mismatch.wrench.force_rows")
TORQUE_ROWS = count("mismatch.wrench.torque_rows")
TO_THRUST = frozenset((Stage.INPUT_DELAY, Stage.INPUT_LIMIT, Stage.THRUST_MAP, Stage.THRUST_LIMIT, Stage.THRUST_SCALE,
                       Stage.MOTOR_GAIN, Stage.LAG))
"""From commands to the thrusts that rotors have."""
KEPT_THRUSTS = 4
CHANNELS = ("force x", "force y", "force z", "torque x", "torque y", "torque z")
"""Of a residual, as accelerations of the body: m/s^2 and rad/s^2."""


def kernel(sigma_s: float, order: int) -> np.ndarray:
    """Weights of a Gaussian (order 0) or of its first or second derivative, for ``convolve1d``.

    Sampled derivatives of a Gaussian do not sum to zero. These weights do, and give the derivative of any polynomial up
    to their order exactly.
    """
    t = np.arange(-np.ceil(5.0 * sigma_s / ROW_S), np.ceil(5.0 * sigma_s / ROW_S) + 1) * ROW_S
    weights = np.exp(-0.5 * (t / sigma_s) ** 2)
    weights /= weights.sum()
    if order == 1:
        weights = -t * weights
        return weights / -(t @ weights)
    if order == 2:
        weights = (t**2 - weights @ t**2) * weights
        return 2.0 * weights / (t**2 @ weights)
    return weights


@dataclass
class Wrench:
    """Tracks, and where on them force and torque are compared."""

    tracks: Sequence[Track]
    slopes: dict[tuple[Any, ...], tuple[np.ndarray, ...]] = field(default_factory=dict, repr=False)
    """Known effects of parameters, see ``fitting.slopes``."""
    _known: dict[tuple[Any, ...], tuple[np.ndarray, np.ndarray]] = field(default_factory=dict, repr=False)
    _thrusts: dict[tuple[Any, ...], tuple[np.ndarray, np.ndarray]] = field(default_factory=dict, repr=False)

    @cached_property
    def unasked(self) -> tuple[str, ...]:
        """Terms that only turn the vehicle, where only forces are compared."""
        return UNASKED if any(t.forces_only for t in self.tracks) else ()

    @property
    def why_unasked(self) -> str:
        """Why ``unasked`` is excluded."""
        return WHY if self.tracks[0].commanded else WHY_STILL

    @cached_property
    def ends(self) -> np.ndarray:
        return np.cumsum([len(t) for t in self.tracks])

    @cached_property
    def _judged(self) -> np.ndarray:
        return joined(self.tracks, "counts")

    @cached_property
    def track(self) -> np.ndarray:
        """(rows,) number of the track."""
        return np.repeat(np.arange(len(self.tracks)), [len(t) for t in self.tracks])

    @cached_property
    def flight(self) -> np.ndarray:
        """(rows,) number of the flight."""
        return np.asarray(np.array([t.flight for t in self.tracks])[self.track])

    @cached_property
    def force_at(self) -> np.ndarray:
        """(N,) rows, of all tracks end to end, where the force is compared."""
        row = np.arange(len(self.track)) - (self.ends - [len(t) for t in self.tracks])[self.track]
        return np.flatnonzero(self._judged & (row % FORCE_ROWS == 0))

    @cached_property
    def torque_at(self) -> np.ndarray:
        """(M,) first rows of the stretches of TORQUE_ROWS over which the torque is compared; empty if it is not
        compared."""
        if self.unasked:
            return np.zeros(0, int)
        row = np.arange(len(self.track)) - (self.ends - [len(t) for t in self.tracks])[self.track]
        starts = np.flatnonzero(self._judged & (row % TORQUE_ROWS == 0))
        starts = starts[starts + TORQUE_ROWS < len(self.track)]
        whole = (self.track[starts + TORQUE_ROWS] == self.track[starts]) & self._judged[starts + TORQUE_ROWS]
        return np.asarray(starts[whole])

    @cached_property
    def quaternion(self) -> np.ndarray:
        return joined(self.tracks, "quaternion")

    @cached_property
    def _state(self) -> np.ndarray:
        """(13, rows)."""
        parts = ("position_m", "velocity_m_s", "quaternion", "rate_rad_s")
        return np.ascontiguousarray(np.concatenate([joined(self.tracks, part) for part in parts], axis=1).T)

    @cached_property
    def battery_V(self) -> np.ndarray:
        """Battery voltage [V] wherever the residual is judged."""
        return np.asarray(joined(self.tracks, "battery_V")[self._judged])

    def of(self, field: str, at: np.ndarray) -> np.ndarray:
        """A field of the tracks at some rows."""
        return np.asarray(joined(self.tracks, field)[at])

    def _smooth(self, values: np.ndarray, order: int) -> np.ndarray:
        """Every track separately, all rows."""
        weights = kernel(SMOOTH_S, order)
        parts = np.split(values, self.ends[:-1])
        return np.concatenate([convolve1d(part, weights, axis=0, mode="nearest") for part in parts])

    def _in_body(self, acceleration: np.ndarray) -> np.ndarray:
        return so3.rotate_inverse(self.quaternion[self.force_at], acceleration[self.force_at])

    @cached_property
    def measured(self) -> tuple[np.ndarray, np.ndarray]:
        """Acceleration (N, 3) m/s^2 and mean angular acceleration of a stretch (M, 3) rad/s^2, body."""
        rate = joined(self.tracks, "rate_rad_s")
        turned = rate[self.torque_at + TORQUE_ROWS] - rate[self.torque_at]
        return (self._in_body(self._smooth(joined(self.tracks, "position_m"), 2)), turned / (TORQUE_ROWS * ROW_S))

    @cached_property
    def axes_smoothed(self) -> np.ndarray:
        """(N, 3, 3) axes of the body in the world, as columns, smoothed as the force is."""
        return self._axes(0)

    @cached_property
    def swung(self) -> np.ndarray:
        """(N, 3, 3) acceleration of a point fixed in the body, world, per m along each axis of the body [1/s^2]."""
        return self._axes(2)

    def _axes(self, order: int) -> np.ndarray:
        axes = so3.matrix(self.quaternion).reshape(-1, 9)
        return np.asarray(self._smooth(axes, order)[self.force_at].reshape(-1, 3, 3))

    def model(self, model: Model, parameters: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """The model's prediction along the measured states, as ``measured``; parameters (P,) replace those of the
        model."""
        if parameters is None:
            if model.key not in self._known:
                self._known[model.key] = self.model(model, model.values)
            return self._known[model.key]
        return self._of_thrust(model, parameters, *self.thrust(model, parameters))

    def thrust(self, model: Model, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, rows) thrusts [N] from the commands, lagged where rotors lag, and the commanded thrusts. The latest ones
        are kept: most parameters change none."""
        concerned = [k for k, slot in enumerate(model.slots) if not TO_THRUST.isdisjoint(slot.term.acts)]
        key = *model.structure, values[concerned].tobytes()
        if key not in self._thrusts:
            if len(self._thrusts) >= KEPT_THRUSTS:
                self._thrusts.pop(next(iter(self._thrusts)))
            inputs = self._inputs(model, values)
            flat = np.concatenate(inputs)
            thrust = np.stack([np.broadcast_to(c, len(flat))
                               for c in equations(model, ROW_S, values).command(list(flat.T))])
            lagged = self._lagged(model, values, inputs, thrust) if "motor_lag" in model else thrust
            self._thrusts[key] = lagged, thrust
        return self._thrusts[key]

    def _of_thrust(self, model: Model, values: np.ndarray, thrust: np.ndarray,
                   command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations, as ``measured``, of rotors (n, rows) that lag already, behind a command."""
        acceleration, turning = self._slopes(model, values, thrust, command)
        return self._in_body(self._smooth(acceleration, 0)), self._over_stretches(turning)

    def _slopes(self, model: Model, values: np.ndarray, thrust: np.ndarray,
                command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(rows, 3) acceleration, world, and angular acceleration, body."""
        made = equations(model, ROW_S, values)
        slope = made.body(list(self._state), list(thrust), list(command))
        acceleration, turning = (np.stack([np.broadcast_to(s, len(self.track)) for s in slope[k:k + 3]], 1)
                                 for k in (3, 10))
        return acceleration, turning

    def _over_stretches(self, turning: np.ndarray) -> np.ndarray:
        """(M, 3) mean over each stretch of (rows, 3)."""
        steps = np.arange(TORQUE_ROWS + 1)
        weight = np.where((steps == 0) | (steps == TORQUE_ROWS), 0.5, 1.0) / TORQUE_ROWS
        return np.asarray(np.einsum("k,nkc->nc", weight, turning[self.torque_at[:, None] + steps]))

    def _inputs(self, model: Model, values: np.ndarray) -> list[np.ndarray]:
        """Rows of inputs of every track; they change with the delay only."""
        delay = values[model.index("command_delay.delay_s")] if "command_delay" in model else 0.0
        key = ("inputs", len(model.inputs), float(delay))
        if key not in self.slopes:
            self.slopes[key] = tuple(rows(model, t.motor[None], t.battery_V[None], row_hz=1.0 / ROW_S,
                                          parameters=values)[0][:, :, 0] for t in self.tracks)
        return list(self.slopes[key])

    def _lagged(self, model: Model, values: np.ndarray, inputs: list[np.ndarray], command: np.ndarray) -> np.ndarray:
        """Rotor states (4, rows) [N] of all tracks, from rest at the first command of each."""
        longest = max(len(i) for i in inputs)
        wide = np.stack([np.concatenate([i, np.repeat(i[-1:], longest - len(i), axis=0)]) for i in inputs], axis=-1)
        first = command[:, self.ends - np.array([len(i) for i in inputs])]
        follow = compiled_lagged(model, 1.0 / ROW_S)
        states = follow(first, wide, values, keep="all")[0]
        return np.concatenate([states[:len(i), :, k].T for k, i in enumerate(inputs)], axis=1)

    def speed_lag(self, model: Model) -> tuple[np.ndarray, np.ndarray]:
        """Change if the speed of a rotor (the root of its thrust) lags instead of the thrust, as ``model`` gives it.
        With noisy commands, thrust is lower by a fraction of their variance. Time constants up and down count as
        their mean."""
        tau = [v for name, v in model.parameters.items() if name.startswith("motor_lag.")]
        key = ("speed lag", *model.key)
        if key not in self.slopes:
            force, torque = (np.zeros_like(part) for part in self.measured)
            if sum(tau) > 0.0:
                force, torque = self._with_speed_lag(model, float(np.mean(tau)))
            self.slopes[key] = force, torque
        force, torque = self.slopes[key]
        return force, torque

    def _with_speed_lag(self, model: Model, tau_s: float) -> tuple[np.ndarray, np.ndarray]:
        made = equations(model, ROW_S, model.values)
        flat = np.concatenate(self._inputs(model, model.values))
        command = np.stack([np.broadcast_to(c, len(flat)) for c in made.command(list(flat.T))])
        share = 1.0 - np.exp(-ROW_S / tau_s)

        def lagged(values: np.ndarray) -> np.ndarray:
            parts = np.split(values, self.ends[:-1], axis=1)
            return np.concatenate([lfilter([share], [1.0, share - 1.0], p, axis=1, zi=(1.0 - share) * p[:, :1])[0]
                                   for p in parts], axis=1)

        command = np.maximum(command, 0.0)
        by_thrust, by_speed = lagged(command), lagged(np.sqrt(command)) ** 2
        one, other = (self._of_thrust(model, model.values, lag, command) for lag in (by_thrust, by_speed))
        return other[0] - one[0], other[1] - one[1]

    def drag_at_rotors(self, model: Model) -> tuple[np.ndarray, np.ndarray]:
        """Change if drag acts at the rotors, in proportion to the speed of each (the root of its thrust), instead of at
        their centre. If rotors turn unevenly, as with an offset centre of mass, drag turns the vehicle about z."""
        key = ("drag at rotors", *model.key)
        if key not in self.slopes:
            thrust, command = self.thrust(model, model.values)
            acceleration, _ = self._slopes(model, model.values, thrust, command)
            gravity = np.array([0.0, 0.0, model.vehicle.gravity_m_s2])
            mass = model.values_of("mass").get("m", model.vehicle.mass_kg)
            inertia = model.values_of("inertia").get("inertia_kg_m2", model.vehicle.inertia_kg_m2)
            force = mass * so3.rotate_inverse(self.quaternion, acceleration + gravity)
            speed = np.sqrt(np.maximum(thrust, 1e-9))
            arm = np.asarray(model.vehicle.motor_positions_m)[:, :2].T @ (speed / speed.sum(axis=0))
            turning = np.zeros_like(acceleration)
            turning[:, 2] = (arm[0] * force[:, 1] - arm[1] * force[:, 0]) / inertia[2]
            self.slopes[key] = np.zeros_like(self.measured[0]), self._over_stretches(turning)
        force, torque = self.slopes[key]
        return force, torque

    def residual(self, model: Model, parameters: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Measured less model: (N, 3) m/s^2, (M, 3) rad/s^2."""
        force, torque = self.model(model, parameters)
        return self.measured[0] - force, self.measured[1] - torque


__all__ = ["CHANNELS", "Wrench"]

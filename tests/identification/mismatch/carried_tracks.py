"""Tracks carried by a model itself: no logging, no controller, no noise, a known truth."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from identification.mismatch.track import ROW_S, Track
from identification.mismatch.wrench import Wrench
from nanobench_tools import so3
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.numeric import equations

MASS_KG = 0.04
C = (0.0, 0.005, 0.0105)
MODEL = Model(Vehicle(mass_kg=MASS_KG), {
    "thrust_voltage": {"c": C}, "motor_lag": {"tau_up_s": 0.04, "tau_down_s": 0.04},
    "yaw_torque": {"k_m": 0.006}, "drag_linear": {"d": (0.016, 0.016, 0.006)}})
"""A vehicle that all tracks here belong to."""
HOVER_V = (-C[1] + np.sqrt(C[1] ** 2 + C[2] * MASS_KG * 9.81)) / (2.0 * C[2])


Push = Callable[[np.ndarray, float], np.ndarray]
"""Position (3,) m, world, and time s -> acceleration (3,) m/s^2, world."""


def _memory(rng: np.random.Generator, n: int, size: float, last_s: float, wide: int) -> np.ndarray:
    """(n, wide) noise that lasts."""
    keep = np.exp(-ROW_S / last_s)
    return lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], size * rng.standard_normal((n, wide)), axis=0)


def track_of(model: Model, seed: int, flight: int = 0, seconds: float = 10.0, push: Push | None = None,
             noise: float = 1.0) -> Track:
    """Attitude and inputs are smooth random signals; position and rate are what ``model`` (and ``push``) makes of
    them. ``noise`` 1: air of 0.04 m/s^2 and moments of 1.5 rad/s^2 that last, motion capture to 0.02 mm, gyro to
    0.003 rad/s.

    Position and rate do not belong to the attitude; no step along the measured states needs them to.
    """
    rng = np.random.default_rng(seed)
    n = round(seconds / ROW_S)
    t = ROW_S * np.arange(n)

    def wave(size: float, hertz: tuple[float, float], many: int = 4) -> np.ndarray:
        f, phase = rng.uniform(*hertz, many), rng.uniform(0.0, 2.0 * np.pi, many)
        return size * np.sin(2.0 * np.pi * f * t[:, None] + phase).sum(axis=1) / np.sqrt(many)

    battery = np.linspace(4.0, 3.5, n) + wave(0.03, (0.05, 0.2))
    volts = HOVER_V * (1.0 + wave(0.02, (0.2, 1.5)))
    motor = np.stack([(volts + wave(0.006, (0.5, 4.0))) / battery for _ in range(4)], axis=1)
    quaternion = so3.from_euler_zyx(wave(0.12, (0.2, 0.5)), wave(0.12, (0.2, 0.5)), wave(0.5, (0.05, 0.2)))
    air, moment = noise * _memory(rng, n, 0.04, 0.4, 3), noise * _memory(rng, n, 1.5, 0.05, 3)
    made = equations(model, ROW_S)
    thrust = [made.command([*motor[0], battery[0]])]
    for i in range(n - 1):
        thrust.append(made.lagged(thrust[-1], [*motor[i], battery[i]]))
    position, velocity, rate = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
    position[:, 2] = 1.0
    last = np.zeros(3)
    for i in range(1, n):  # second differences of the path are the accelerations of the row between (Verlet)
        before = i - 1
        velocity[before] = (position[before] - position[max(before - 1, 0)]) / ROW_S + 0.5 * ROW_S * last
        slope = made.body([*position[before], *velocity[before], *quaternion[before], *rate[before]], thrust[before])
        last = np.array(slope[3:6]) + air[before] + (0.0 if push is None else push(position[before], t[before]))
        position[i] = 2.0 * position[before] - position[max(before - 1, 0)] + ROW_S**2 * last
        ahead = made.body([*position[i], *velocity[before], *quaternion[i], *rate[before]], thrust[i])
        turning = 0.5 * (np.array(slope[10:13]) + np.array(ahead[10:13]) + moment[before] + moment[i])
        rate[i] = rate[before] + ROW_S * turning
    velocity[-1] = velocity[-2]
    counts = np.zeros(n, bool)
    counts[60:-20] = True
    return Track(f"flight_{flight + 1}", flight, t, position + 2e-5 * noise * rng.standard_normal((n, 3)), velocity,
                 quaternion, rate + 3e-3 * noise * rng.standard_normal((n, 3)), np.full((n, 3), np.nan), motor, battery,
                 counts, t, np.zeros((n, 2)))


def wrench_of(model: Model, flights: int = 3, **options) -> Wrench:
    return Wrench([track_of(model, 10 + k, k, **options) for k in range(flights)])

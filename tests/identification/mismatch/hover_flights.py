"""Hovering flights with the streams of a small log: commands, battery, position, velocity, acceleration, roll, yaw."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.thrust.firmware import PLUS
from nanobench_tools.flight import Flight, Provenance, make_stream

RATE_HZ, ON_S, OFF_S, END_S = 100.0, 1.0, 16.0, 17.0
HOVER_N = 0.08
"""Per motor."""


def voltage_of(thrust_N: np.ndarray) -> np.ndarray:
    """Inverse of the curve by a table: independent of the closed form."""
    volts = np.linspace(1.0, 4.5, 3501)
    return np.interp(thrust_N, np.polynomial.polynomial.polyval(volts, PLUS.c), volts)


def hover(name: str, asked: Sequence[float] = (0.0, 0.0, 0.0, 0.0), *, seed: int = 0, climb_m_s2: float = 0.0,
          felt: Sequence[float] = (0.0, 0.0), push_left: float = 0.0, battery_V: float | None = 3.7,
          swing: tuple[float, float] = (0.0, 1.0), on: bool = True) -> Flight:
    """``asked`` (4,): ln of the thrust that each motor is asked for, over HOVER_N. climb_m_s2: amplitude of a vertical
    acceleration of 0.5 Hz; push_left m/s^2: force over mass to the left that the roll balances; swing (m/s^2, Hz):
    the same, to and fro, that it does not balance; battery_V None: stands still."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, END_S, 1.0 / RATE_HZ)
    flying = (t >= ON_S) & (t <= OFF_S) & on
    a_z = climb_m_s2 * np.sin(2.0 * np.pi * 0.5 * t) * flying
    battery = np.full(len(t), 3.7) if battery_V is None else battery_V - 0.01 * t - 0.2 * flying
    thrust = HOVER_N * np.exp(np.asarray(asked)) * (1.0 + a_z[:, None] / 9.81)
    ratio = voltage_of(thrust) / battery[:, None] * np.exp(0.01 * rng.standard_normal((len(t), 4)))
    wave = 0.3 * np.sin(2.0 * np.pi * 0.2 * t) * flying  # a sway that the roll asks for
    pendulum = swing[0] * np.sin(2.0 * np.pi * swing[1] * t + rng.uniform(0.0, 6.0)) * flying
    a_y = wave + pendulum + 0.02 * rng.standard_normal(len(t))
    roll = -(wave - push_left * flying) / 9.81 + 0.0005 * rng.standard_normal(len(t))
    rise = np.clip((t - ON_S) / 1.0, 0.0, 1.0) * 0.5 * flying
    velocity = np.stack([0.0 * t, np.cumsum(a_y) / RATE_HZ, np.cumsum(a_z) / RATE_HZ], axis=1)
    position = np.stack([0.0 * t, np.cumsum(velocity[:, 1]) / RATE_HZ, rise], axis=1)
    acc = np.stack([felt[0] + 0.0 * t, felt[1] + a_y, a_z], axis=1)

    def stream(kind: str, values: np.ndarray, quantities: Sequence[str]):
        return make_stream(kind, t, np.asarray(values, float).reshape(len(t), -1), quantities, rate_hz=RATE_HZ,
                           samples=len(t))

    streams = {"motor": stream("motor", np.where(flying[:, None], ratio, 0.0), ("m1", "m2", "m3", "m4")),
               "battery": stream("battery", battery, ("vbat",)),
               "estimator": stream("estimator", np.column_stack([position, velocity]),
                                   ("x", "y", "z", "vx", "vy", "vz")),
               "estimator_acc": stream("estimator_acc", acc, ("ax", "ay", "az")),
               "attitude": stream("attitude", np.stack([roll, 0.0 * t], axis=1), ("roll", "yaw"))}
    return Flight(name, streams, {}, Provenance(f"{name}.log", f"{name}{seed}", "made"))

"""Features of class ``state``: was the vehicle in balance on the inputs of the half second before the start?

A vehicle that neither tumbles nor falls has, on average, motors that balance its weight, its trim and the moment of
the air. So the mean moments and thrust that the model gives to the inputs before the start, beside the velocity,
attitude and rate at the start, tell the trim of this vehicle today. Only inputs and the start state are used.
"""

from __future__ import annotations

import numpy as np

from nanobench_tools import so3
from nanobench_tools.physics import Model
from nanobench_tools.physics.inputs import rows, settled

FEATURES = ("moment_roll", "moment_pitch", "moment_yaw", "thrust", "velocity_x", "velocity_y", "velocity_z", "rate_x",
            "rate_y", "rate_z", "up_x", "up_y", "up_z", "battery", "one")
VOLTS = 3.5
SIDES = np.array([[-1.0, -1.0, 1.0, 1.0], [-1.0, 1.0, 1.0, -1.0], [-1.0, 1.0, -1.0, 1.0], [1.0, 1.0, 1.0, 1.0]])
"""Of motors 1..4: left against right, back against front, one spin against the other, all."""


def balance(model: Model, start: np.ndarray, motor: np.ndarray, battery_V: np.ndarray,
            past: tuple[np.ndarray, np.ndarray], row_hz: float) -> np.ndarray:
    """Features (n, 15). start (n, 13); motor (n, H, 4), battery_V (n, H), of which the first row is used; past
    (motor (n, P, 4), battery (n, P))."""
    _, before = rows(model, motor[:, :1], battery_V[:, :1], past, row_hz=row_hz)
    count, width, n = before.shape
    thrust = settled(model, before.transpose(1, 0, 2).reshape(width, -1), row_hz=row_hz)
    mean = thrust.reshape(4, count, n).mean(axis=1)
    weight = model.vehicle.mass_kg * model.vehicle.gravity_m_s2
    sums = (SIDES @ mean - np.array([[0.0], [0.0], [0.0], [weight]])) / weight
    quaternion = start[:, 6:10]
    velocity = so3.rotate_inverse(quaternion, start[:, 3:6])
    up = so3.rotate_inverse(quaternion, np.array([0.0, 0.0, 1.0]))
    return np.column_stack([*sums, velocity, start[:, 10:13], up - np.array([0.0, 0.0, 1.0]), battery_V[:, 0] - VOLTS,
                            np.ones(n)])

"""Features of class ``state``: was the vehicle in balance on the inputs of the half second before the start?

A vehicle that neither tumbles nor falls has, on average, motors that balance its weight, its trim and the moment of
the air. So the current trim of this vehicle follows from the mean moments and thrust that the model gives to the
inputs before the start. Velocity, attitude and rate at the start help, too. The newest inputs also reflect the motion
just before, because a controller or pilot answered it with them. Only inputs up to the start and the start state are
used.
"""

import numpy as np

from nanobench_tools import so3
from nanobench_tools.physics import Model
from nanobench_tools.physics.inputs import rows, settled
from nanobench_tools.settings import number, setting

from .symmetry import Features

VOLTS = number("greybox.balance_features.volts")
MIX = np.array([[-1.0, -1.0, 1.0, 1.0], [-1.0, 1.0, 1.0, -1.0], [-1.0, 1.0, -1.0, 1.0], [1.0, 1.0, 1.0, 1.0]])
"""Of motors 1..4: left against right, back against front, one spin against the other, all."""
BEFORE = setting("greybox.balance_features.before")


def balance(model: Model, start: np.ndarray, motor: np.ndarray, battery_V: np.ndarray,
            past: tuple[np.ndarray, np.ndarray], row_hz: float, found: Features) -> None:
    """Adds to ``found``. ``start`` (n, 13); ``motor`` (n, H, 4), battery_V (n, H), of which the first row is used; past
    (motor (n, P, 4), battery (n, P))."""
    _, before = rows(model, motor[:, :1], battery_V[:, :1], past, row_hz=row_hz)
    count, width, n = before.shape
    thrust = settled(model, before.transpose(1, 0, 2).reshape(width, -1), row_hz=row_hz)
    mean = thrust.reshape(4, count, n).mean(axis=1)
    weight = model.vehicle.mass_kg * model.vehicle.gravity_m_s2
    sums = ((MIX @ mean - np.array([[0.0], [0.0], [0.0], [weight]])) / weight).T
    quaternion = start[:, 6:10]
    velocity = so3.rotate_inverse(quaternion, start[:, 3:6])
    found.turn(sums[:, :3])
    found.level(sums[:, 3])
    found.move(velocity)
    found.turn(start[:, 10:13])
    found.move(so3.rotate_inverse(quaternion, np.array([0.0, 0.0, 1.0])) - np.array([0.0, 0.0, 1.0]))
    found.level(battery_V[:, 0] - VOLTS)
    found.level(np.sum(velocity[:, :2] ** 2, axis=1))


def newest(past: tuple[np.ndarray, np.ndarray], found: Features) -> None:
    """Adds the motor voltages of the last rows, as moments and sum."""
    volts = past[0] * past[1][..., None]
    for low, high in BEFORE:
        end = volts.shape[1] - low
        mean = volts[:, max(end - (high - low), 0):max(end, 1)].mean(axis=1) @ MIX.T
        found.turn(mean[:, :3])
        found.level(mean[:, 3])

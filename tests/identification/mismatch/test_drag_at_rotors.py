"""Drag that acts at the rotors, more at those that turn faster: its moment by hand, and no finding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from carried_tracks import MODEL, C, track_of

from identification.mismatch import fitting
from identification.mismatch.diagnosis import _named
from identification.mismatch.fitting import Slopes, fit
from identification.mismatch.space import space_around
from identification.mismatch.wrench import TORQUE_ROWS, Wrench
from nanobench_tools import so3

UNEVEN = np.array([1.08, 1.05, 0.93, 0.94])
"""Motors of a vehicle whose centre of mass lies beside that of its rotors."""


def leaning(seed: int, flight: int = 0):
    """A track with uneven motors."""
    track = track_of(MODEL, seed, flight)
    return replace(track, motor=track.motor * UNEVEN)


def by_rotor(track) -> np.ndarray:
    """(rows,) angular acceleration about z [rad/s^2]: each rotor's part of the drag, at its place, without lag."""
    volts = track.motor * track.battery_V[:, None]
    speed = np.sqrt(C[1] * volts + C[2] * volts**2)
    velocity = so3.rotate_inverse(track.quaternion, track.velocity_m_s)
    found = np.zeros(len(track))
    for i, (x, y) in enumerate(MODEL.vehicle.motor_positions_m):
        force = -0.016 * velocity[:, :2] * (speed[:, i] / speed.sum(axis=1))[:, None]
        found += (x * force[:, 1] - y * force[:, 0]) / MODEL.vehicle.inertia_kg_m2[2]
    return found


def test_it_is_the_sum_over_rotors():
    track = leaning(3)
    wrench = Wrench([track])
    force, torque = wrench.drag_at_rotors(MODEL.without("motor_lag"))
    expected = by_rotor(track)
    expected = 0.25 * expected[:-2] + 0.5 * expected[1:-1] + 0.25 * expected[2:]
    assert TORQUE_ROWS == 2
    np.testing.assert_allclose(torque[:, 2], expected[wrench.torque_at], atol=1e-6 * np.abs(expected).max())
    assert np.abs(expected).max() > 0.1
    assert not force.any()
    assert not torque[:, :2].any()


def test_even_rotors_and_no_drag_have_none():
    even = replace(leaning(3), motor=np.repeat(leaning(3).motor.mean(axis=1, keepdims=True), 4, axis=1))
    assert np.abs(Wrench([even]).drag_at_rotors(MODEL)[1]).max() < 1e-12
    assert np.abs(Wrench([leaning(3)]).drag_at_rotors(MODEL.without("drag_linear"))[1]).max() < 1e-9


@pytest.mark.slow
def test_a_vehicle_whose_drag_acts_there_leaves_nothing(monkeypatch):
    wrench = Wrench([leaning(30 + k, k) for k in range(2)])
    change = wrench.drag_at_rotors(MODEL)
    wrench.measured = tuple(a + b for a, b in zip(wrench.model(MODEL), change, strict=True))
    rng = np.random.default_rng(5)
    wrench.measured = tuple(part + size * rng.standard_normal(part.shape)
                            for part, size in zip(wrench.measured, (0.02, 0.02), strict=True))
    space = space_around(MODEL)
    moments, named = _named(wrench, space, MODEL, lambda text: None)
    assert not named.accepted
    here = fit(Slopes(moments), space.model, []).loss
    monkeypatch.setattr(fitting, "AT_ROTORS", 0.0)
    assert fit(Slopes(moments), space.model, []).loss > here + 100.0

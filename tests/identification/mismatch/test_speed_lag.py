"""Rotors whose speed lags instead of their thrust: no finding, and the size of it against finer steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from carried_tracks import MASS_KG, MODEL, C, track_of

from identification.mismatch import fitting
from identification.mismatch.diagnosis import _named
from identification.mismatch.fitting import Slopes, fit
from identification.mismatch.memory import Memory
from identification.mismatch.space import space_around
from identification.mismatch.wrench import Wrench

TAU_S = 0.04


def shaken(seed: int, flight: int = 0):
    """A track whose motors are commanded up and down by a fifth, more and less through the flight."""
    track = track_of(MODEL, seed, flight)
    rng = np.random.default_rng(seed)
    size = 0.2 * np.sin(np.linspace(0.0, 3.0 * np.pi, len(track))) ** 2
    return replace(track, motor=track.motor * (1.0 + size[:, None] * rng.choice([-1.0, 1.0], track.motor.shape)))


def integrated(track) -> np.ndarray:
    """Thrust of all rotors over mass, speed lagging less thrust lagging, in fifty steps a row."""
    volts = track.motor * track.battery_V[:, None]
    asked = np.repeat(C[1] * volts + C[2] * volts**2, 50, axis=0)
    thrust, speed = asked[0].copy(), np.sqrt(asked[0])
    gap = np.empty(len(asked))
    for k, target in enumerate(asked):
        gap[k] = np.sum(speed**2 - thrust) / MASS_KG
        thrust += 2e-4 / TAU_S * (target - thrust)
        speed += 2e-4 / TAU_S * (np.sqrt(target) - speed)
    return gap[::50]


@pytest.mark.slow
def test_it_is_what_finer_steps_give():
    track = shaken(3)
    wrench = Wrench([track])
    force, torque = wrench.speed_lag(MODEL)
    expected = wrench._smooth(integrated(track)[:, None] * np.ones(3), 0)[wrench.force_at, 2]
    assert expected.min() < -0.02
    late = wrench.of("since_s", wrench.force_at) > 1.0
    np.testing.assert_allclose(force[late, 2], expected[late], atol=0.05 * np.abs(expected).max())
    assert np.abs(force[:, :2]).max() < 0.02 * np.abs(force[:, 2]).max()
    assert torque.shape == wrench.measured[1].shape


def test_rotors_that_do_not_lag_have_none():
    force, torque = Wrench([shaken(3)]).speed_lag(MODEL.without("motor_lag"))
    assert not force.any()
    assert not torque.any()


def test_a_vehicle_whose_rotors_lag_in_speed_has_no_other_thrust(monkeypatch):
    wrench = Wrench([shaken(30 + k, k) for k in range(3)])
    change = wrench.speed_lag(MODEL)
    wrench.measured = tuple(a + b for a, b in zip(wrench.model(MODEL), change, strict=True))
    rng = np.random.default_rng(5)
    wrench.measured = tuple(part + size * rng.standard_normal(part.shape)
                            for part, size in zip(wrench.measured, (0.02, 0.3), strict=True))
    space = space_around(MODEL)
    moments, named = _named(wrench, space, MODEL, lambda text: None)
    assert not named.accepted
    here = fit(Slopes(moments), space.model, []).loss
    monkeypatch.setattr(fitting, "SPEED_LAG", 0.0)
    assert fit(Slopes(moments), space.model, []).loss > here + 100.0


def test_colour_undoes_whitening_within_runs():
    rng = np.random.default_rng(1)
    runs = np.concatenate([np.arange(40), np.arange(25)])
    memory = Memory(np.array([0.6, -0.2, 0.1]), runs)
    white = np.where(memory.judged, rng.standard_normal(65), 0.0)
    coloured = memory.colour(white)
    np.testing.assert_allclose(memory.whiten(coloured)[memory.judged], white[memory.judged], atol=1e-12)
    assert coloured[40:43] == pytest.approx([0.0, 0.0, 0.0])

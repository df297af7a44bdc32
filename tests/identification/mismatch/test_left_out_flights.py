"""Flights left out: tilts that sessions share, and commands that shake."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from carried_tracks import MODEL, wrench_of

from identification.mismatch.posterior.left_out_flights import (
    Predictions,
    _as_sessions_differ,
    _calmed,
    _lift_gain,
)


def test_flights_of_one_session_may_share_a_tilt():
    """Of a mean of 0.5 and -3.0 beside usual 0.2 and 1.0, only 0.2 and -1.0 are left; differences stay."""
    offsets = np.array([[0.4, -3.1, 0.0], [0.6, -2.9, 0.0]])
    found = _as_sessions_differ(offsets, np.array([0.2, 1.0, 0.0]))
    assert found == pytest.approx(np.array([[0.1, -1.1, 0.0], [0.3, -0.9, 0.0]]))


@pytest.mark.parametrize("noise", [0.0, 0.5, 1.0])
def test_noisy_commands_lift_a_vehicle_less(noise):
    """Noise of variance s^2 on a fast command of variance 1: the regression has a gain of 1 / (1 + s^2)."""
    rng = np.random.default_rng(0)
    true, shake = rng.normal(size=(2, 20_000))
    measured, made = np.zeros((2, 20_000, 3))
    measured[:, 2], made[:, 2] = true + np.linspace(0.0, 9.0, 20_000), true + noise * shake
    wrench = SimpleNamespace(track=np.zeros(20_000, int), force_at=np.arange(20_000), measured=(measured, measured))
    gain = _lift_gain(wrench, measured - made, np.ones(20_000, bool))
    assert gain == pytest.approx(1.0 / (1.0 + noise**2), abs=0.01)


def test_only_the_common_fast_part_of_commands_is_calmed():
    rng = np.random.default_rng(1)
    track = wrench_of(MODEL, flights=1, seconds=6.0).tracks[0]
    slow = np.linspace(0.5, 0.6, len(track))[:, None]
    differ = 0.01 * rng.normal(size=(len(track), 1)) * [1.0, -1.0, 1.0, -1.0]
    shaken = replace(track, motor=slow + differ + 0.05 * rng.normal(size=(len(track), 1)))
    calm = _calmed(shaken, 0.0).motor
    assert calm - calm.mean(1, keepdims=True) == pytest.approx(differ, abs=1e-12)
    assert calm.mean(1)[100:-100] == pytest.approx(slow[100:-100, 0], abs=0.02)
    assert _calmed(shaken, 1.0).motor == pytest.approx(shaken.motor)


PATH, TURNING = slice(0, 2), slice(2, 4)


@pytest.mark.parametrize(("term", "axes", "improved", "nats"), [
    ("com_offset", set(), TURNING, 3.0 * np.log(2.0)), ("com_offset", {0, 1}, TURNING, 0.0),
    ("com_offset", {0, 1}, PATH, 3.0 * np.log(2.0)), ("angular_damping", set(), TURNING, 0.0),
    ("inertia", {0, 1}, TURNING, 0.0), ("inertia", set(), PATH, 3.0 * np.log(2.0))])
def test_turning_speaks_neither_for_a_sluggish_vehicle_nor_next_to_set_points(term, axes, improved, nats):
    """A flight of 3 windows whose errors are halved: 3 log 2, if that error counts."""
    errors = {(): np.ones((1, 3, 4)), (0,): np.ones((1, 3, 4))}
    errors[0,][..., improved] = 0.5
    case = SimpleNamespace(effects=[SimpleNamespace(term=term)], rows=SimpleNamespace(set_point_axes=axes))
    predictions = Predictions(case, ["a"], 0)
    predictions.windows = np.array([3.0])
    predictions.of = lambda found: errors[found.chosen]
    assert predictions.likelihood(*(SimpleNamespace(chosen=c) for c in ((0,), ()))) == pytest.approx(nats)


@pytest.mark.parametrize(("term", "worse", "log"), [
    ("drag_torque", TURNING, np.log(3.0)), ("inertia", TURNING, 0.0), ("inertia", PATH, np.log(3.0)),
    ("mass", PATH, np.log(3.0))])
def test_what_predicts_three_times_worse_is_seen(term, worse, log):
    """Nothing is known of the third quantity; the other flight is not predicted at all."""
    errors = {(0,): np.ones((2, 3, 4)), (0, 1): np.ones((2, 3, 4))}
    errors[0, 1][..., worse] = 3.0
    for each in errors.values():
        each[1], each[0, :, 2] = 0.0, np.nan
    case = SimpleNamespace(effects=[SimpleNamespace(term=t) for t in ("motor_lag", term)])
    predictions = Predictions(case, ["a", "b"], 0)
    predictions.of = lambda found: errors[found.chosen]
    with_it, without = (SimpleNamespace(chosen=c) for c in ((0, 1), (0,)))
    assert max(predictions.worse(with_it, without)) == pytest.approx(log)
    assert min(predictions.worse(without, with_it)) == pytest.approx(-log)

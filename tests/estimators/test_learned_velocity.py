"""The learned velocity: what it may know, that it finds a law it was shown, and what the filter makes of it."""

from dataclasses import replace

import numpy as np
import pytest

from estimators import inertial, learned_velocity
from estimators.learned_velocity import EVERY, LearnedVelocityEkf, Weights, features, fitted, shipped
from nanobench_tools import so3
from nanobench_tools.protocols import blackout
from nanobench_tools.protocols.task3 import given_and_trained


def test_a_law_it_was_shown_comes_back_with_its_noise():
    """Velocity linear in the features, constants of each flight beside it, noise that grows with the velocity."""
    rng = np.random.default_rng(0)
    by = rng.normal(0.0, 1.0, (2, 4))
    flights = []
    for _ in range(6):
        x = rng.normal(0.0, 1.0, (4000, 2, 4))
        y = np.einsum("nkf,kf->nk", x, by)
        sd = np.sqrt(0.01 + 0.04 * y**2)
        flights.append((x + rng.normal(0.0, 3.0, (2, 4)), y + sd * rng.normal(size=y.shape) + rng.normal(0.0, 2.0, 2)))
    weights = fitted(flights)
    assert np.allclose(weights.by, by, atol=0.02)
    assert weights.floor == pytest.approx(0.01, abs=0.006)
    assert weights.slope == pytest.approx(0.04, rel=0.1)


def test_features_know_nothing_later(crowd):
    flight = crowd.flight("slow trefoil")
    imu = flight["imu"]
    bent = imu.values.copy()
    bent[imu.time_s > 8.0] += 1.0
    time_s, found = features(flight)
    _, other = features(flight.with_streams(imu=replace(imu, values=bent)))
    assert np.array_equal(found[time_s <= 8.0], other[time_s <= 8.0])
    assert not np.allclose(found[time_s > 8.0], other[time_s > 8.0])


def test_a_flight_is_not_told_by_weights_that_saw_its_type(crowd):
    """The shipped sets differ by type, and the one of a flight is that its type was left out of."""
    sets = shipped()
    flight = crowd.flight("slow trefoil")
    rows = inertial.rows_of(blackout.given_until(flight, 8.0))
    method = LearnedVelocityEkf()
    by_family = {name: method.measured(replace(flight, metadata={**flight.metadata, "family": name}), rows)
                 for name in ("trefoil", "circle", "no such type")}
    time_s, found = features(flight)
    found = found[np.searchsorted(time_s, rows.time_s)]
    assert np.array_equal(by_family["trefoil"], sets["trefoil"].measured(found))
    assert np.array_equal(by_family["no such type"], sets[EVERY].measured(found))
    assert not np.allclose(by_family["trefoil"][:, :2], by_family["circle"][:, :2])


def test_the_row_says_what_it_was_trained_on():
    assert "all trajectory types but the flight's own" in given_and_trained(LearnedVelocityEkf(), blackout.GIVEN)
    assert given_and_trained(inertial.Inertial(), blackout.GIVEN) == blackout.GIVEN


def test_what_is_told_bounds_the_velocity_and_a_bias_is_taken_for_one(crowd):
    """Plain integration, told the true body velocity less 0.4 s times a bias that the poses before revealed."""
    flight = crowd.flight("slow trefoil")
    t0 = 10.0
    rows = inertial.rows_of(blackout.given_until(flight, t0))
    mocap = flight["mocap"]
    true_s, velocity = mocap.time_s, mocap["vx", "vy", "vz"]
    at = so3.interpolate(true_s, mocap["qx", "qy", "qz", "qw"], np.clip(rows.time_s, true_s[0], true_s[-1]))
    world = np.stack([np.interp(rows.time_s, true_s, column) for column in velocity.T], axis=1)
    body = so3.rotate(so3.conjugate(at), world)[:, :2]
    n = len(body)
    told = np.column_stack([body, np.full((n, 2), 0.3), np.zeros((n, 2))])
    values = inertial.values_of({**LearnedVelocityEkf.settings, "drag": 0.0, "air_sd": 0.0})
    end = min(t0 + 10.0, rows.time_s[-1])

    def off(estimate):
        true = [np.interp(end, true_s, mocap[name]) for name in ("px", "py")]
        return float(np.hypot(*(np.interp(end, rows.time_s, estimate.position_m[:, k]) - true[k] for k in (0, 1))))

    alone, aided = inertial.run(rows, values), inertial.run(rows, values, measured=told)
    assert off(aided) < 0.5 * off(alone)
    gain = -2.0
    shifted = rows.acc + np.array([0.05, -0.04, 0.0])
    biased = np.column_stack([body + gain * np.array([0.05, -0.04]), np.full((n, 2), 0.3), np.full((n, 2), gain)])
    other = inertial.run(replace(rows, acc=shifted), values, measured=biased)
    assert off(other) < off(aided) + 0.1


def test_weights_move_with_a_constant_error_as_they_say():
    """An accelerometer off by a constant for long: the velocity told moves by what the last columns say."""
    weights = Weights(np.random.default_rng(1).normal(size=(2, 14)), 0.01, 0.0)
    size = len(learned_velocity.FADES_S)
    one, two = np.zeros((1, 2, 14)), np.zeros((1, 2, 14))
    two[:, :, :size] = 0.03
    first, second = weights.measured(one), weights.measured(two)
    assert np.allclose(second[:, :2] - first[:, :2], 0.03 * first[:, 4:])

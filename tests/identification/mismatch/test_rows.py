"""Rows of forces and moments, and set-points as instruments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from carried_tracks import MODEL, wrench_of
from scipy.signal import lfilter

from identification.mismatch.memory import runs_of
from identification.mismatch.posterior.effects import effects_of, within_reach
from identification.mismatch.posterior.rows import Seen, _Group, _ridge, instruments, rows_of
from identification.mismatch.space import space_around
from identification.mismatch.wrench import TORQUE_ROWS, Wrench
from nanobench_tools.physics import Model


def test_a_wrong_trim_is_no_noise_and_no_gain():
    """A constant moment of 40 rad/s^2 in every flight. The noise of the instruments stays the same, and no term that
    multiplies the moment of the motors has a constant part with which it could hide that."""
    wrench = wrench_of(MODEL, flights=2, seconds=8.0)
    force, torque = wrench.residual(MODEL)
    trim = np.zeros((len(torque), 3, 1))
    trim[:, 0] = 1.0
    nothing = np.zeros((len(force), 3, 1))
    quiet, wrong = (rows_of(wrench, (force, torque + constant * trim[..., 0]), nothing, trim, np.full(1, 50.0))
                    for constant in (0.0, 40.0))
    for one, other in zip(quiet.turnings, wrong.turnings, strict=True):
        assert np.diag(other.spread.sum(0)) == pytest.approx(np.diag(one.spread.sum(0)), rel=0.3)
    lopsided = Model(MODEL.vehicle, {**MODEL.as_dict(), "motor_imbalance": {"g": (0.9, 1.0, 1.1, 1.0)}})
    space = within_reach(wrench, space_around(lopsided))
    means = {e.term: np.abs(e.torque.mean(0)).max() for e in effects_of(wrench, space, lopsided)}
    assert means["inertia"] < 1e-6 < means["com_offset"]


def closed_loop(flights: int = 6, n: int = 700):
    """A command that answers a slow disturbance and shakes between rows, and the moment it makes, three times it, with
    the disturbance; beside them the set-point that the command follows, and the flight of each row."""
    rng = np.random.default_rng(1)
    asked, disturbance = (lfilter([1.0], [1.0, -0.9], rng.normal(size=flights * n)) for _ in range(2))
    command = asked - 0.3 * disturbance + 1.5 * rng.normal(size=flights * n)
    held = asked - 0.3 * disturbance
    return asked, command, 3.0 * held + disturbance + rng.normal(size=flights * n), np.repeat(np.arange(flights), n)


def test_set_points_find_the_gain_that_feedback_and_noisy_inputs_hide():
    asked, command, moment, flight = closed_loop()
    assert command @ moment / (command @ command) < 2.2
    group = _Group.of(np.arange(6), flight, np.arange(len(flight)), asked[:, None])
    turning = group.turning(0, True, np.ones(len(flight)), moment - 3.0 * command)
    columns = np.stack([command, moment], axis=1)[:, None]
    every = np.ones(6, bool)
    whole = turning.asked(turning.of(columns), every)
    assert float(_ridge(whole)[0]) == pytest.approx(3.0, abs=0.2)
    # rows are in standard deviations of the noise: seven of them, a constant for each flight and the set-point
    noise = whole @ [-3.0, 1.0]
    assert noise.shape == (7,)
    assert np.sqrt(np.mean(noise**2)) < 2.5
    # flights left out are as if they had never flown
    keep = np.array([True, False, True, True, False, True])
    mine = keep[flight]
    alone = _Group.of(np.arange(4), np.searchsorted(np.flatnonzero(keep), flight[mine]), np.arange(int(mine.sum())),
                      asked[mine, None]).turning(0, True, np.ones(int(mine.sum())), (moment - 3.0 * command)[mine])
    want = alone.asked(alone.of(columns[mine]), np.ones(4, bool))
    found = turning.asked(turning.of(columns), keep)
    assert found.T @ found == pytest.approx(want.T @ want, rel=0.05)


def test_columns_of_both_stand_beside_each_other():
    one, other = (Seen((np.full((3, k), float(k)),), (np.full((2, 4, k), float(k)),)) for k in (1, 2))
    both = one + other
    assert both.many == 3
    assert both.force[0][0].tolist() == [1.0, 2.0, 2.0]
    assert both.turning[0][0, 0].tolist() == [1.0, 2.0, 2.0]


@pytest.mark.parametrize(("size", "together"), [(0.0, False), (1e-4, False), (1.0, True)])
def test_set_points_are_instruments_where_they_move(size, together):
    """Rounding of a set-point at rest asks for something too, and says nothing."""
    tracks = wrench_of(MODEL, flights=1, seconds=6.0).tracks
    wave = size * np.sin(6.0 * tracks[0].time_s)[:, None] * [1.0, 1.0]
    wrench = Wrench([replace(t, asked_rad_s2=wave) for t in tracks])
    made, runs = wrench.model(MODEL)[1], runs_of(wrench.torque_at, TORQUE_ROWS, wrench.track)
    assert [instruments(wrench, axis, made, runs)[1] for axis in range(3)] == [together, together, False]

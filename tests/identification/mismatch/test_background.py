"""Columns of the background against hand-worked cases."""

from __future__ import annotations

import numpy as np
import pytest
from carried_tracks import MODEL, wrench_of

from identification.mismatch.posterior.arm_unit import arms
from identification.mismatch.posterior.background import (
    _beside,
    _equal_lag,
    background_of,
    smooth,
)
from identification.mismatch.posterior.effects import effects_of, within_reach
from identification.mismatch.space import space_around
from identification.mismatch.tracked_point import centred
from identification.mismatch.wrench import Wrench
from nanobench_tools import so3


def test_functions_have_the_covariance_of_their_process():
    """exp(-d^2 / 2 l^2) of the distance in standard deviations, but for the mean that is taken away."""
    x = np.linspace(-2.0, 2.0, 81)[:, None]
    found = smooth(x, 0.8)
    z = x / x.std()
    kernel = np.exp(-0.5 * ((z - z.T) / 0.8) ** 2)
    centre = np.eye(81) - 1.0 / 81
    assert found.shape[1] < 12
    assert np.abs(found @ found.T - centre @ kernel @ centre).max() < 0.1


def test_functions_do_not_depend_on_the_order_of_rows():
    """They are functions of the place: rows in another order get the same values, but for signs and the choice of
    POINTS."""
    rng = np.random.default_rng(3)
    x = rng.normal(size=(300, 3))
    order = rng.permutation(300)
    found, mixed = smooth(x, 1.5), smooth(x[order], 1.5)
    assert found[order] @ found[order].T == pytest.approx(mixed @ mixed.T, abs=1e-6)


def test_a_discrepancy_says_nothing_about_drag():
    """Along every axis its columns have no part that is proportional to the velocity along it, only across it."""
    rng = np.random.default_rng(0)
    air = rng.normal((0.5, 0.0, 0.0), 1.0, (200, 3))
    columns = np.einsum("nk,ij->nijk", smooth(air, 3.0), np.eye(3)).reshape(200, 3, -1)
    found = _beside(air, columns)
    centred = air - air.mean(0)
    assert np.abs(np.einsum("ni,nik->ik", centred, found)).max() < 1e-9
    assert np.abs(centred[:, 0] @ found[:, 1]).max() > 1.0
    curved = columns[:, 0] - centred[:, [0]] * np.linalg.lstsq(centred[:, [0]], columns[:, 0], rcond=None)[0]
    assert found[:, 0] == pytest.approx(curved)


def test_a_trim_turns_with_the_thrust():
    """A centre of mass beside the middle turns the vehicle as the trim of a flight does, row by row."""
    wrench = wrench_of(MODEL, flights=2, seconds=6.0)
    space = within_reach(wrench, space_around(MODEL))
    effects = effects_of(wrench, space, MODEL)
    found = background_of(wrench, space, effects, arms(MODEL))
    moments = next(e.torque for e in effects if e.term == "com_offset")
    trim, com = found.torque[..., found.group == "roll_trim"][:, 0], moments[:, 0, 1]
    first = wrench.flight[wrench.torque_at] == 0
    ratio = trim[first] / com[first, None]
    assert com[first].std() > 0.01 * np.abs(com[first]).mean()
    assert np.abs(ratio[:, 0]).min() > 0.0
    assert ratio.std(0).max() < 1e-9 * np.abs(ratio).max()


def test_a_tracked_point_swings_around_the_centre_of_mass():
    """A path of a point 8, -5 and 20 mm off the centre adds three columns times these numbers to the measured force."""
    arm = np.array([0.008, -0.005, 0.02])
    centre = wrench_of(MODEL, flights=2, seconds=6.0)
    marker = Wrench(centred(centre.tracks, -arm))
    body = so3.matrix(centre.quaternion[centre.force_at])
    added = np.einsum("nji,njk,k->ni", body, centre.swung, arm)
    assert np.abs(added).max() > 0.02
    assert marker.measured[0] - centre.measured[0] == pytest.approx(added, abs=1e-9)


def test_small_commands_may_be_followed_equally_fast_up_and_down():
    """0.02 and 0.08 s: 0.04 s twice, and half the way to 0.02 s. A simulator with one lag needs neither."""
    wrench, model = wrench_of(MODEL, flights=1, seconds=6.0), MODEL.with_parameters(
        {"motor_lag.tau_up_s": 0.02, "motor_lag.tau_down_s": 0.08})
    (mean, _), (short, _) = _equal_lag(wrench, model)
    forty = wrench.model(MODEL)[0]  # MODEL has 0.04 s twice
    twenty = wrench.model(MODEL.with_parameters({"motor_lag.tau_up_s": 0.02, "motor_lag.tau_down_s": 0.02}))[0]
    assert mean == pytest.approx(forty - wrench.model(model)[0])
    assert short == pytest.approx(0.5 * (twenty - forty))
    assert min(np.abs(mean).max(), np.abs(short).max()) > 0.0
    assert _equal_lag(wrench, MODEL) == []

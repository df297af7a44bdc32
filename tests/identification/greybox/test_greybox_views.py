"""Corrections of starts, and gains that roll and pitch share: against central differences, a vehicle turned by a
quarter, and gains that are known."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_windows import TERMS, made_windows, true_model

from identification.greybox.balance_features import BEFORE, balance, newest
from identification.greybox.fit import nuisances_of
from identification.greybox.fitted_predictor import GreyBoxPredictor
from identification.greybox.nuisance import STARTS, terms_of
from identification.greybox.residuals import HORIZONS
from identification.greybox.sensitivity import sensitivities
from identification.greybox.solve import Problem
from identification.greybox.starts import NAMES, moved
from identification.greybox.symmetry import Features, joined
from identification.greybox.window_gains import _seen, learn_gains
from nanobench_tools import so3
from nanobench_tools.flight import Span
from nanobench_tools.physics import Vehicle
from nanobench_tools.physics.fit_bounds import bounds
from nanobench_tools.physics.inputs import rows, warmed
from nanobench_tools.physics.rollout import rollout
from nanobench_tools.protocols.windows import cut_windows

sys.path.insert(0, str(Path(__file__).parents[2] / "protocols"))
from made_flights import made_flight


def test_derivatives_by_the_start_are_those_of_the_rollout():
    model = true_model()
    data = made_windows(model, n=8)
    window, before = rows(model, data.motor, data.battery_V, data.past, row_hz=100.0)
    rotors = warmed(model, window, before, row_hz=100.0).T
    _, slopes = sensitivities(model, data.start, data.motor, data.battery_V, data.past,
                              np.zeros((len(model.names), len(NAMES))), keep=HORIZONS, starts=np.eye(len(NAMES)))
    for i, name in enumerate(NAMES):
        step = 1e-6 * np.eye(len(NAMES))[i]
        flown = [rollout(model, moved(data.start, rotors, sign * np.tile(step, (8, 1))), data.motor, data.battery_V,
                         data.past)[:, HORIZONS, :13] for sign in (1.0, -1.0)]
        central = ((flown[0] - flown[1]) / 2e-6).transpose(1, 2, 0)
        assert np.abs(slopes[:, i] - central).max() < 1e-4 * np.abs(central).max(), name


def test_a_start_that_is_not_corrected_is_the_start():
    start, rotors = np.random.default_rng(0).normal(size=(2, 3, 13))[0], np.full((3, 4), 0.1)
    np.testing.assert_array_equal(moved(start, rotors, np.zeros((3, 7))), np.column_stack([start, rotors]))


def test_what_is_wrong_with_the_start_is_learnt_once_for_roll_and_pitch():
    """Rates at the start are off by what a feature says, here 0.6 of it: the gains are 0.6 on both axes."""
    model = true_model()
    data = made_windows(model, n=400, noise=0.1)
    rng = np.random.default_rng(3)
    told, idle = rng.normal(0.0, 0.1, (2, len(data), 3))
    start = data.start.copy()
    start[:, 10:13] -= 0.6 * told
    features = Features()
    features.turn(told)
    features.move(idle)
    lower, upper = bounds(model)
    problem = Problem(model, replace(data, start=start), np.ones(len(model.names), bool), lower, upper)
    gains, ridge = learn_gains(problem, model.values, features, STARTS)
    assert np.isfinite(ridge)
    np.testing.assert_allclose(np.diag(gains[:3, :3]), 0.6, atol=0.05)
    assert gains[0, 0] == pytest.approx(gains[1, 1], rel=0.1)
    assert gains[0, 4] == pytest.approx(-gains[1, 3], abs=1e-3)
    assert np.abs(gains[:3, :3] - np.diag(np.diag(gains[:3, :3]))).max() == 0.0
    assert np.abs(gains[:3, 3:]).max() < 0.03


@pytest.mark.parametrize("adapt", ["inputs", "past"])
def test_a_vehicle_turned_by_a_quarter_is_told_the_same(adapt):
    """Body axes turned by 90 degrees about z: what was roll is pitch, the motors have other numbers, and every
    correction turns with them. (Rotors then spin the other way round, so yaw is left out.)"""
    windows, _ = cut_windows(made_flight("made"), (Span(3.0, 6.0),), "onboard", past=True)
    terms = {**TERMS, "motor_imbalance": {"g": (1.0,) * 4}, "drag_linear": {"d": (0.016, 0.016, 0.008)},
             "angular_damping": {"d_r": (2e-4, 2e-4, 1e-4)}, "inertia": {"inertia_kg_m2": (2.6e-5, 2.6e-5, 3.1e-5)}}
    terms.pop("yaw_torque")
    nuisances = nuisances_of(adapt)
    made = GreyBoxPredictor("made", {**terms_of(nuisances), **terms}, Vehicle(), adapt, scale=np.ones((8, 4)),
                            nuisances_=nuisances)
    quarter = np.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])

    def turned(vector):
        return np.stack([vector[..., 1], -vector[..., 0], vector[..., 2]], axis=-1)

    def attitude(quaternion):
        flat = quaternion.reshape(-1, 4)
        return so3.multiply(flat, np.broadcast_to(quarter, flat.shape)).reshape(quaternion.shape)

    past = windows.past
    other = replace(windows, quaternion=attitude(windows.quaternion), rate_rad_s=turned(windows.rate_rad_s),
                    motor=np.roll(windows.motor, 1, axis=-1), motor_past=np.roll(windows.motor_past, 1, axis=-1),
                    past=replace(past, quaternion=attitude(past.quaternion), rate_rad_s=turned(past.rate_rad_s),
                                 motor=np.roll(past.motor, 1, axis=-1)))
    features = made.features(windows)
    seen, count = _seen(features, nuisances)
    learnt = np.random.default_rng(0).normal(size=count)
    for one in seen:
        learnt[one.place[-1]] = 0.0
    made = replace(made, gains=np.array([one.gains(learnt, features.matrix().shape[1]) for one in seen]))
    before, after = made.nuisances(windows), made.nuisances(other)
    names = [n.name for n in nuisances]
    assert np.abs(before).max() > 1.0
    for family in ("trim", "tilt", "rate", "rotors"):
        roll, pitch = (names.index(f"{family}_{side}") for side in ("roll", "pitch"))
        np.testing.assert_allclose(after[:, roll], before[:, pitch], atol=1e-6 * np.abs(before).max())
        np.testing.assert_allclose(after[:, pitch], -before[:, roll], atol=1e-6 * np.abs(before).max())
    np.testing.assert_allclose(after[:, 0], before[:, 0], atol=1e-6 * np.abs(before).max())


def test_features_of_class_state_see_no_input_after_the_first():
    model = true_model()
    data = made_windows(model, n=6)
    found = []
    for motor in (data.motor, np.concatenate([data.motor[:, :1], 0.3 + 0.0 * data.motor[:, 1:]], axis=1)):
        features = Features()
        newest(data.past, features)
        balance(model, data.start, motor, data.battery_V, data.past, 100.0, features)
        found.append(features.matrix())
    np.testing.assert_array_equal(*found)


def test_newest_inputs_by_hand():
    """Motors 3 and 4, on the left, at 0.6 over the last two rows and at 0.5 before: so 0.8 V of roll at 4 V."""
    motor = np.full((1, 50, 4), 0.5)
    motor[:, -2:, 2:] = 0.6
    features = Features()
    newest((motor, np.full((1, 50), 4.0)), features)
    moments = features.matrix().reshape(-1, 4)
    assert len(moments) == len(BEFORE)
    np.testing.assert_allclose(moments[:2], np.tile([0.8, 0.0, 0.0, 8.8], (2, 1)), atol=1e-12)
    np.testing.assert_allclose(moments[2:], np.tile([0.0, 0.0, 0.0, 8.0], (len(BEFORE) - 2, 1)), atol=1e-12)


def test_batches_end_to_end_keep_their_views():
    parts = []
    for n in (2, 3):
        features = Features()
        features.lean(np.full((n, 2), float(n)))
        features.level(np.arange(n))
        parts.append(features)
    both = joined(parts)
    assert both.matrix().shape == (5, 3)
    assert both.views == parts[0].views

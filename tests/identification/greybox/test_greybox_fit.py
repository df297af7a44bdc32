"""The estimator: habits of scikit-learn, a model that flies, fits that are no result."""

from dataclasses import replace

import numpy as np
import pytest
from made_windows import TERMS, made_windows, true_model

from identification.greybox import flyability
from identification.greybox.ablation_study import fit_item, predictor_of
from identification.greybox.fit import GreyBox, tidy
from identification.greybox.fit_windows import Cut
from identification.greybox.flyability import flies, hover
from identification.greybox.ladder import LADDER
from identification.greybox.solve import Prior
from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.methods import Prediction, Windows
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.terms.inertia import most
from nanobench_tools.results.fitted_values import Estimate


def cuts_of(data):
    found = []
    for i, name in enumerate(data.names):
        d = data.rows(data.flight == i)
        windows = Windows(d.start[:, :3], d.start[:, 3:6], d.start[:, 6:10], d.start[:, 10:], d.motor, d.battery_V,
                          100.0, *d.past)
        found.append(Cut(name, windows, Prediction(d.truth[..., :3], d.truth[..., 3:6], d.truth[..., 6:10],
                                                   d.truth[..., 10:]), 10))
    return found


FEW = 40
"""Windows of a fit."""
SHARED = {name: values for name, values in TERMS.items() if name != "thrust_scale"}


@pytest.fixture(scope="module")
def fitted():
    return GreyBox(SHARED, name="made").fit_cuts(cuts_of(made_windows(true_model(), n=FEW, noise=0.3)))


@pytest.mark.slow
def test_learnt_values_have_units_and_intervals(fitted):
    entry = fitted.parameters_["drag_linear.d[0]"]
    assert entry.unit == "N s/m"
    assert entry.ci95[0] < entry.value < entry.ci95[1]
    assert entry.value == pytest.approx(0.016, rel=0.1)
    assert fitted.result_.is_result, fitted.result_.trouble
    text = fitted.result_.summary()
    assert "N s/m" in text
    assert "prior" in text
    assert "held by a plain controller" in text


def test_prediction_is_that_of_the_model(fitted):
    cut = cuts_of(made_windows(true_model(), seed=9))[0]
    found = fitted.predict(cut.windows)
    assert np.abs(found.position_m - cut.came.position_m).max() < 0.01


def test_what_flights_do_not_show_is_held_where_it_does_nothing():
    """A fit that would take a parameter across zero leaves the effect out; one that ends on another bound is none."""
    none = true_model().with_parameters({"drag_linear.d[2]": -0.004})
    fitted = GreyBox(SHARED, judged=False).fit_cuts(cuts_of(made_windows(none, n=FEW)))
    assert fitted.parameters_["drag_linear.d[2]"] == Estimate(0.0, None, "N s/m", "held")
    assert fitted.result_.is_result, fitted.result_.trouble
    assert any("drag_linear.d[2]" in text for text in fitted.result_.not_identified)
    slow = true_model().with_parameters({"motor_lag.tau_up_s": 0.4, "motor_lag.tau_down_s": 0.4})
    other = GreyBox(SHARED, judged=False).fit_cuts(cuts_of(made_windows(slow, n=FEW)))
    assert not other.result_.is_result
    assert "NO RESULT" in other.result_.summary()


def test_a_model_whose_rate_is_held_is_fitted_too():
    """Its inertia is no estimate, so the prior of the inertia must not drown the errors."""
    rung = next(r for r in LADDER if r.name == "fit_drag")
    found = GreyBox(rung.terms, judged=False).fit_cuts(cuts_of(made_windows(true_model(), n=FEW)))
    assert found.result_.steps > 5
    slope = np.polyval(np.polyder(np.array([0.0037, 0.02, 0.01])), 2.9)
    c = found.model_.values_of("thrust_voltage")["c"]
    assert np.polyval(np.polyder(np.array(c[::-1])), 2.9) == pytest.approx(slope, rel=0.3)


def test_priors_of_ones_own_replace_those_of_the_same_parameters():
    mine = Prior(("motor_lag.tau_up_s",), 0.06, 1e-5, "a motor on a stand")
    found = GreyBox(SHARED, soft=(mine,), judged=False).fit_cuts(cuts_of(made_windows(true_model(), n=FEW)))
    assert found.parameters_["motor_lag.tau_up_s"].value == pytest.approx(0.06, abs=1e-3)
    assert [text for text in found.result_.priors if "tau_up" in text] == [
        "motor_lag.tau_up_s = 0.06 +- 1e-05 (a motor on a stand)"]


def test_result_draws_itself(fitted):
    assert len(fitted.result_.plot().data) > 5


def test_not_fitted_and_unknown_settings_are_one_line():
    with pytest.raises(UsageError, match="not fitted yet"):
        GreyBox().predict(None)
    with pytest.raises(UsageError, match="adapt"):
        GreyBox(adapt="future")
    with pytest.raises(UsageError, match="no_such_term"):
        GreyBox(terms=["no_such_term"])


def test_a_mass_in_grams_is_one_line():
    with pytest.raises(InputError, match="mass_kg") as error:
        GreyBox(vehicle=Vehicle(mass_kg=40.85)).fit_cuts(cuts_of(made_windows(true_model(), n=20)))
    assert "\n" not in str(error.value)


def test_the_model_flies_and_one_whose_motors_do_nothing_does_not(fitted, monkeypatch):
    assert fitted.result_.flown.stable
    monkeypatch.setattr(flyability, "SECONDS", 1.0)  # it falls out of reach before
    weak = true_model().with_parameters({"thrust_voltage.c[0]": 0.1, "thrust_voltage.c[1]": 1e-4,
                                         "thrust_voltage.c[2]": 0.0})
    assert not flies(weak, fitted.data_).stable


def test_hover_is_where_thrust_carries_the_weight():
    model = true_model()
    data = made_windows(model)
    half = model.with_parameters({f"thrust_voltage.c[{k}]": c / 2.0 for k, c in enumerate((0.01, 0.02, 0.0037))})
    ratio, logged, battery_V = hover(model, data)
    assert ratio == pytest.approx(1.0, abs=0.06)
    assert hover(half, data)[0] > 1.2
    assert logged * battery_V == pytest.approx(2.9, abs=0.2)


def test_a_flight_that_hovers_longer_counts_no_more_in_the_hover_command():
    model = true_model()
    data = made_windows(model)
    rows = np.concatenate([np.arange(len(data.flight)), *[np.flatnonzero(data.flight == 0)] * 5])
    longer = replace(data, start=data.start[rows], motor=data.motor[rows], battery_V=data.battery_V[rows],
                     past=(data.past[0][rows], data.past[1][rows]), truth=data.truth[rows], flight=data.flight[rows])
    assert hover(model, longer) == pytest.approx(hover(model, data))


def test_windows_on_the_ground_are_no_hover():
    model = true_model()
    data = made_windows(model)
    idle = data.flight == 0
    motor, start, truth = data.motor.copy(), data.start.copy(), data.truth.copy()
    motor[idle] *= 0.3
    start[idle, 3:6] = truth[idle, :, 3:6] = 0.0
    start[idle, 10:] = truth[idle, :, 10:13] = 0.0
    assert hover(model, replace(data, motor=motor, start=start, truth=truth))[0] == pytest.approx(1.0, abs=0.06)


@pytest.mark.slow
def test_a_vehicle_that_the_air_tips_over_needs_the_fast_loop(monkeypatch):
    """drag_torque as on the recorded vehicles: a slow attitude loop loses it, a fast one holds it."""
    model = Model(Vehicle(), {"thrust_voltage": {"c": (-0.004, 0.032, -0.0096, 0.0042)}, "thrust_scale": {"s": 0.88},
                              "motor_lag": {"tau_up_s": 0.055, "tau_down_s": 0.119},
                              "inertia": {"inertia_kg_m2": (1.7e-5, 1.7e-5, 3.0e-5)}, "yaw_torque": {"k_m": 0.0068},
                              "drag_linear": {"d": (0.0155, 0.0155, 0.006)}, "drag_torque": {"c": -6.4e-4}})
    data = made_windows(true_model(), n=20)
    assert flies(model, data).stable
    monkeypatch.setattr(flyability, "ATTITUDE_GAINS", flyability.ATTITUDE_GAINS[:1])
    assert not flies(model, data).stable


def test_no_vehicle_has_more_inertia_than_with_all_its_mass_at_the_motors():
    np.testing.assert_allclose(most(true_model().vehicle), 0.04085 * 0.0325**2 * np.array([1.0, 1.0, 2.0]))


def test_gains_of_motors_have_mean_one_and_neutral_terms_go():
    model = tidy(true_model().with_parameters({"motor_imbalance.g[0]": 1.0201}))
    assert np.mean(model.values_of("motor_imbalance")["g"]) == pytest.approx(1.0, abs=1e-12)
    assert "thrust_scale" not in model


def test_a_gain_on_its_bound_is_a_model():
    gains = {f"motor_imbalance.g[{k}]": value for k, value in enumerate((0.2, 1.26, 1.26, 1.281))}
    model = tidy(true_model().with_parameters(gains))
    assert min(model.values_of("motor_imbalance")["g"]) == 0.2


def test_ablation_names_are_unique_and_classes_are_not_mixed():
    assert len({rung.name for rung in LADDER}) == len(LADDER)
    assert [rung.name for rung in LADDER if rung.information == "past"] == ["fit_observed"]


def test_without_casadi_nothing_is_fitted_and_one_line_says_so(monkeypatch, capsys):
    from nanobench_tools.cli import sysid_models as sysid
    from nanobench_tools.steps.options import Options

    monkeypatch.setattr(sysid.importlib.util, "find_spec", lambda name: None)
    assert sysid.fitted(Options(), ["a case"], "short", 0.04) == ({}, {})
    assert capsys.readouterr().err.count("\n") == 1
    assert sysid.fitted(Options(), [], "none", 0.04) == ({}, {})


@pytest.mark.real
@pytest.mark.slow
def test_on_real_flights_two_kinds_of_fit_come_back_from_plain_values(real_data):
    from identification.greybox.fit_windows import cases_of
    from nanobench_tools.protocols.task1 import score
    from nanobench_tools.sources.discover import load_recordings

    names = ("B2_circle_medium_rep1", "B7_oval_medium_rep2", "B8_star_slow_rep1", "B5_helix_slow_rep1")
    paths = [next(real_data.glob(f"nanobench/**/{name}.csv*")) for name in names]
    cases = cases_of(load_recordings(paths).flights)
    at_50 = {}
    for rung in (r for r in LADDER if r.adapt != "none" and not r.physical):
        predictor = predictor_of(fit_item(cases[:3], rung, 0, Vehicle()))
        found = score(cases[3], predictor, "onboard")
        at_50[rung.adapt] = {name: sums[-1] / found.windows for name, sums in found.sums.items()}
    assert at_50["inputs"]["position_mae_m"] < 0.15
    assert at_50["past"]["position_mae_m"] < 0.08
    assert at_50["past"]["attitude_mae_rad"] < 0.7 * at_50["inputs"]["attitude_mae_rad"]

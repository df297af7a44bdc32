"""Fits to series with known truth, the choice among maps, intervals, and what is refused."""

import numpy as np
import pytest
from made_stands import dc_law, drive, made, text

from identification.thrust import ThrustModel
from identification.thrust.choose import choose
from identification.thrust.maps import MAPS
from identification.thrust.stand_fit import fit_stands
from identification.thrust.thrust_study import errors, study
from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.results.fitted_values import Estimate

TRUTH = {"kappa": 0.02, "rho": 0.09, "e_0": -0.05}


def test_dc_motor_is_recovered_without_noise():
    fit = fit_stands(MAPS["dc_motor"], [made(dc_law)])
    assert fit.trouble == ""
    for name, value in TRUTH.items():
        assert fit.values[name] == pytest.approx(value, rel=0.02, abs=2e-3)


@pytest.mark.slow
def test_intervals_hold_the_truth():
    files = [made(dc_law, seed=s, noise_N=3e-4, name=f"s{s}") for s in range(8)]
    found = study(files, 0.04, draws=50)
    inside = [lo <= TRUTH[n] <= hi for n, (lo, hi) in
              ((n, b.ci95) for n, b in found.parameters()["dc_motor"].items())]
    assert sum(inside) >= 2


@pytest.mark.slow
def test_two_files_give_no_interval():
    """Drawn from two, a parameter's interval would end at the values of the files alone."""
    found = study([made(dc_law, seed=s, noise_N=3e-4, name=f"s{s}") for s in range(2)], 0.04, draws=20)
    assert {(body.ci95, body.ci_why) for body in found.parameters()["dc_motor"].values()} == {
        (None, "two files, drawn in three ways only")}


@pytest.mark.parametrize("law", [dc_law, lambda u, v: 0.012 * (u * v) ** 2, lambda u, v: 0.03 * u**1.6 * v**1.1,
                                 lambda u, v: 0.0045 * (0.6 + u * (v + 1.6)) ** 2])
@pytest.mark.slow
def test_whatever_the_law_the_choice_holds_on_a_new_file(law):
    """Held-out error within 40 % of the noise, below a map without voltage and both firmware curves."""
    files = [made(law, seed=s, noise_N=5e-4, name=f"s{s}") for s in range(3)]
    found = study(files[:2], 0.04, draws=0)
    rms = {n: float(np.sqrt(np.mean(errors(f, files[2]) ** 2))) for n, f in found.fits.items()}
    assert rms[found.best] < 1.4 * 5e-4
    assert rms[found.best] < min(rms["thrust_pwm"], rms["firmware_2_1_plus"], rms["firmware_legacy"])


def test_interval_covers_new_files():
    files = [made(dc_law, seed=s, noise_N=5e-4, name=f"s{s}") for s in range(14)]
    found = study(files[:4], 0.04, draws=0)
    missed = np.concatenate([errors(found.fits[found.best], f) for f in files[4:]])
    assert 0.92 < np.mean(np.abs(missed) <= found.half_width[found.best]) <= 1.0


def test_a_fit_on_its_bound_is_said_and_never_chosen():
    """Thrust that falls with the voltage: no exponent at or above zero can say that."""
    found = study([made(lambda u, v: 0.4 * u**1.5 * v**-1.0)], 0.04, draws=0)
    assert "b sits on its bound 0" in found.fits["power_law"].trouble
    assert found.best != "power_law"
    only = {"power_law": found.fits["power_law"]}
    assert choose(only, found.scores) is None


def test_constant_voltage_leaves_no_voltage_law():
    steady = made(lambda u, v: 0.1 * u**2 + 0.01 * u)
    steady.battery_V[:] = 3.7
    found = study([steady], 0.04, draws=0)
    for name in ("switched_motor", "thrust_voltage", "pwm_voltage"):
        assert "never changes" in found.fits[name].trouble
    assert found.best == "thrust_pwm"


@pytest.mark.parametrize("law", [lambda u, v: 0.02 + 0.0 * u, lambda u, v: 0.1 * (1.2 - u)])
def test_no_map_is_chosen_where_pwm_explains_nothing(law):
    assert study([made(law, noise_N=5e-3)], 0.04, draws=0).best is None


def write(tmp_path, content, name="stand.csv"):
    path = tmp_path / name
    path.write_text(content)
    return path


@pytest.mark.slow
def test_model_from_a_file(tmp_path):
    u, voltage = drive()
    path = write(tmp_path, text(u, voltage, dc_law(u, voltage)))
    model = ThrustModel(draws=20).fit([path])
    assert model.kind_ == "stand"
    assert float(model.predict(0.7, 3.7)) == pytest.approx(dc_law(0.7, 3.7), abs=1e-3)
    assert model.score([path]) > 0.999
    assert model.best_ in model.summary()
    assert all(isinstance(found, Estimate) for found in model.parameters_.values())
    with pytest.raises(UsageError, match="ratio"):
        model.predict(40000, 3.7)


def test_zero_of_the_load_cell_is_taken_off(tmp_path):
    u, voltage = drive()
    u = np.concatenate([np.zeros(6), u])
    voltage = np.concatenate([np.full(6, 4.0), voltage])
    thrust = dc_law(u, voltage) * (u > 0) - 0.003
    model = ThrustModel(draws=0).fit([write(tmp_path, text(u, voltage, thrust))])
    assert float(model.predict(0.7, 3.7)) == pytest.approx(dc_law(0.7, 3.7), abs=1e-3)
    assert model.study_.train[0].still == 6


def test_rows_in_the_dead_zone_are_not_fitted(tmp_path):
    u, voltage = drive()
    still = u < 0.25
    thrust = np.where(still, 0.0, dc_law(u, voltage))
    model = ThrustModel(draws=0).fit([write(tmp_path, text(u, voltage, thrust))])
    assert model.study_.train[0].still == still.sum()


def test_without_battery_only_pwm_is_fitted(tmp_path):
    u, _ = drive()
    content = text(u, None, 0.12 * u**2, header="pwm,thrust[g]")
    model = ThrustModel(draws=0).fit([write(tmp_path, content)])
    assert model.best_ == "thrust_pwm"
    assert "no battery voltage" in model.study_.fits["switched_motor"].trouble


BAD = {
    "zero load cell": (lambda u, v: text(u, v, 0.0 * u), "no thrust"),
    "constant PWM": (lambda u, v: text(0.0 * u + 0.5, v, dc_law(0.5, v)), "PWM never changes"),
    "few rows": (lambda u, v: text(u[:6], v[:6], dc_law(u[:6], v[:6])), "6 rows spin"),
    "PWM as a ratio": (lambda u, v: text(u / 65535.0, v, dc_law(u, v)).replace("\n1,", "\n0.5,"), "in pwm16"),
    "battery in mV": (lambda u, v: text(u, v, dc_law(u, v), volts=1000.0), "mV"),
    "thrust in kg": (lambda u, v: text(u, v, dc_law(u, v), header="pwm,vbat[V],thrust[kg]"), "unit in brackets"),
    "grams as newton": (lambda u, v: text(u, v, dc_law(u, v), header="pwm,vbat[V],thrust[N]"), "unit in brackets"),
    "newton as grams": (lambda u, v: text(u, v, dc_law(u, v), grams=0.00981), "unit in brackets"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_series_are_refused_in_one_line(tmp_path, case):
    content, said = BAD[case]
    path = write(tmp_path, content(*drive()))
    with pytest.raises(InputError) as caught:
        ThrustModel(draws=0).fit([path])
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_series_without_battery_voltage_takes_no_map_from_the_others(tmp_path):
    from identification.thrust.thrust_rows import stand_rows
    from nanobench_tools.sources import load_recordings

    u, volts = drive(40)
    (tmp_path / "with.csv").write_text(text(u, volts, dc_law(u, volts)))
    rows = [line.split(",") for line in text(u, volts, dc_law(u, volts)).splitlines()]
    (tmp_path / "without.csv").write_text("\n".join(f"{a},{c}" for a, _, c in rows) + "\n")
    flights = load_recordings([tmp_path], cache=False).flights
    found = stand_rows(flights)
    assert [s.name for s in found.files] == ["with"]
    assert found.reasons == {"without": "no battery voltage, which the other series have"}
    assert [s.name for s in stand_rows([f for f in flights if f.name == "without"]).files] == ["without"]

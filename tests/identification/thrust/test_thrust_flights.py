"""Fits to flights made from a known law: what is recovered, what a level per flight does, what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from identification.thrust.flight_fit import effect_columns, find_delay, fit_flights, models
from identification.thrust.flight_rows import Flown, fly
from identification.thrust.prediction_intervals import half_width
from identification.thrust.thrust_study import errors, study
from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.flight import Flight, Provenance, Span, make_stream
from nanobench_tools.steps.options import Options
from nanobench_tools.steps.thrusting import thrust_maps

MASS = 0.04
KAPPA, OFFSET, DROP = 0.0045, 0.7, 1.5
EFFECTS = np.array([0.02, 0.006, 0.003, -0.2, 0.1, 0.3])


def made_flight(seed: int, level: float = 0.0, noise: float = 0.05, n: int = 600) -> Flown:
    rng = np.random.default_rng(seed)
    battery = np.linspace(3.9, 3.3, n) + 0.1 * rng.normal() + 0.02 * rng.normal(size=n)
    u = np.clip(3.0 / battery[:, None] + 0.06 * rng.normal(size=(n, 4)), 0.3, 1.0)
    flown = Flown(f"f{seed}", f"f{seed}.csv", f"f{seed}", 0.05, np.arange(n) / 20.0, u, battery, np.zeros(n),
                  0.3 * rng.normal(size=n), rng.uniform(0.0, 2.0, n), 6.0 * (1.0 - np.exp(-np.arange(n) / 200.0)),
                  0.03 * rng.normal(size=(n, 3)), np.zeros((n, 6)), True)
    force = (KAPPA * (OFFSET + u * (battery[:, None] + DROP)) ** 2).sum(axis=1) / MASS
    force = force + EFFECTS @ effect_columns(flown) + level + noise * rng.normal(size=n)
    return replace(flown, force=force)


def test_law_and_effects_are_recovered():
    found = fit_flights(models(MASS)["switched_motor_in_flight"], [made_flight(s) for s in range(6)])
    assert found.trouble == ""
    for name, truth, within in (("k_z", 0.02, 0.002), ("k_h", 0.006, 0.002), ("heat", 0.003, 0.001),
                                ("trim_roll", -0.2, 0.05), ("trim_pitch", 0.1, 0.05), ("trim_yaw", 0.3, 0.05),
                                ("s", DROP, 0.3), ("e_0", OFFSET, 0.4)):
        assert found.values[name] == pytest.approx(truth, abs=within), name
    new = made_flight(99)
    assert np.sqrt(np.mean((found.predict(new) - new.force) ** 2)) < 0.06


def test_levels_of_flights_do_not_bend_the_voltage_law():
    """Flights at a low battery that are also heavier: the drop stays where it is."""
    level = np.linspace(-0.4, 0.4, 8)
    flights = [made_flight(s, level=x) for s, x in enumerate(level)]
    found = fit_flights(models(MASS)["switched_motor_in_flight"], flights)
    assert found.values["s"] == pytest.approx(DROP, abs=0.4)


def test_mass_only_scales():
    flights = [made_flight(s) for s in range(3)]
    light, heavy = (fit_flights(models(m)["thrust_voltage"], flights) for m in (MASS, 2.0 * MASS))
    assert np.allclose(light.predict(flights[0]), heavy.predict(flights[0]), atol=1e-6)
    assert heavy.values["c[1]"] == pytest.approx(2.0 * light.values["c[1]"], rel=1e-6)


@pytest.mark.slow
def test_choice_and_interval_on_new_flights():
    found = study([made_flight(s, level=0.1 * np.sin(s)) for s in range(6)], MASS, draws=0)
    assert found.best == "switched_motor_in_flight"
    new = [made_flight(s, level=0.1 * np.sin(s)) for s in range(50, 60)]
    missed = np.concatenate([errors(found.fits[found.best], f) for f in new])
    assert np.mean(np.abs(missed) <= found.half_width[found.best]) > 0.9


def test_interval_is_wide_for_few_files():
    errors_of = [np.full(50, 0.1), np.full(50, -0.1)]
    assert half_width(errors_of, 2) > 4.0 * half_width(errors_of * 10, 20)


def test_without_velocity_the_effects_are_not_fitted():
    flights = [replace(made_flight(s), moving=False) for s in range(2)]
    assert "no velocity" in fit_flights(models(MASS)["switched_motor_in_flight"], flights).trouble


@pytest.mark.parametrize("mass", [0.0, -1.0, 40.85, float("nan")])
def test_a_mass_that_cannot_be(mass):
    with pytest.raises(UsageError, match="mass"):
        models(mass)


def logged(lag_s: float = 0.05, streams: dict | None = None, pwm: bool = True) -> Flight:
    """A recording of 30 s at 100 Hz whose specific force follows the inputs with a lag."""
    t = np.arange(0.0, 30.0, 0.01)
    base = 0.75 + 0.05 * np.sin(3.0 * t) * pwm
    u = np.stack([base] * 4, axis=1)
    late = 0.75 + 0.05 * np.sin(3.0 * (t - lag_s)) * pwm
    force = 4.0 * KAPPA * (OFFSET + late * (3.7 + DROP)) ** 2 / MASS
    z = np.where((t > 2.0) & (t < 28.0), 1.0, 0.0)
    made = {"motor": make_stream("motor", t, u, ("m1", "m2", "m3", "m4")),
            "battery": make_stream("battery", t, np.full((len(t), 1), 3.7), ("vbat",)),
            "imu": make_stream("imu", t, force[:, None], ("acc_z",)),
            "mocap": make_stream("mocap", t, z[:, None], ("pz",))}
    return Flight("made", {k: v for k, v in made.items() if k not in (streams or {})}, {},
                  Provenance("made.csv", "0", "test"))


def test_delay_is_found():
    assert find_delay([(logged(0.06), (Span(2.0, 28.0),))], MASS) == pytest.approx(0.06, abs=0.011)


def test_rows_are_low_passed_specific_force_in_the_air():
    rows = fly(logged(), (Span(2.0, 28.0),), 0.05)
    assert rows.time_s[0] > 2.2
    assert rows.time_s[-1] < 27.8
    assert len(rows) == pytest.approx(25.5 * 20.0, abs=3)
    assert rows.force.mean() == pytest.approx(4.0 * KAPPA * (OFFSET + 0.75 * 5.2) ** 2 / MASS, rel=0.01)


@pytest.mark.parametrize(("flight", "spans", "said"), [
    (logged(streams={"battery"}), (Span(2.0, 28.0),), "no battery"),
    (logged(), (Span(0.0, 1.5),), "clean rows in the air"),
    (logged(pwm=False), (Span(2.0, 28.0),), "PWM never changes"),
])
def test_flights_that_cannot_be_fitted(flight, spans, said):
    with pytest.raises(InputError, match=said):
        fly(flight, spans)


def test_a_recording_that_starts_in_the_air_shows_no_ground():
    """Logs of 500 Hz that begin and end in flight: their lowest place is no resting place."""
    whole = logged()
    inside = whole.with_streams(**{name: s.rows((s.time_s > 3.0) & (s.time_s < 27.0))
                                   for name, s in whole.streams.items()})
    rows = fly(inside, (Span(3.0, 27.0),), 0.05)
    assert len(rows) == pytest.approx(22.0 * 20.0, abs=3)


def test_flights_that_cannot_be_fitted_say_why():
    still, rng = logged(pwm=False), np.random.default_rng(1)
    noisy = still.with_streams(**{name: replace(s, values=s.values + 1e-4 * rng.standard_normal(s.values.shape))
                                  for name, s in still.streams.items()})
    with pytest.raises(InputError, match="PWM never changes"):
        thrust_maps(Options(quiet=True), [noisy])

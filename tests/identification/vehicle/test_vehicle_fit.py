"""The physical vehicle: found again where it is known, the same for every choice of flights, honest about priors."""

from dataclasses import replace

import numpy as np
import pytest

from identification.vehicle import motion_sums as sums
from identification.vehicle.vehicle_fit import THRUST_SPREAD, fit_vehicle, thrust_spread
from identification.vehicle.vehicle_priors import PriorsFile, priors_of
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.errors import InputError
from nanobench_tools.firmware.thrust_curve import thrust_of_voltage
from nanobench_tools.flight import Span
from nanobench_tools.physics import Vehicle
from nanobench_tools.physics.simulator import dumps, loads
from nanobench_tools.practice.vehicle_parameters import VEHICLE
from nanobench_tools.protocols.task1 import training_cases

NAMES = ("slow figure_eight", "fast figure_eight", "fast trefoil")
CURVE = np.array([-0.004, 0.032, -0.0096, 0.0042])


@pytest.fixture(scope="module")
def cases(crowd):
    flights = [crowd.flight(name) for name in NAMES]
    return training_cases(flights, {f.name: audit(f) for f in flights})


@pytest.fixture(scope="module")
def fitted(cases):
    return fit_vehicle(cases)


def test_the_vehicle_is_found_again(fitted):
    """Its thrust at hover, drag, and moment of the air, by the practice vehicle's own numbers."""
    model, mass = fitted.model, Vehicle().mass_kg
    at = 2.85
    thrust = model.parameters["thrust_scale.s"] * np.polynomial.polynomial.polyval(
        at, model.values_of("thrust_voltage")["c"])
    assert thrust == pytest.approx(VEHICLE["thrust_scale"].value * float(thrust_of_voltage(np.array(at))), rel=0.05)
    assert model.parameters["drag_linear.d[0]"] / mass == pytest.approx(VEHICLE["drag_lateral_1_s"].value, rel=0.1)
    truth, prior = VEHICLE["drag_torque_N_s"].value, -5.7e-4
    assert abs(model.parameters["drag_torque.c"] - truth) < 0.6 * abs(prior - truth)
    assert fitted.flights == len(NAMES)


def test_what_flights_cannot_identify_is_marked_and_keeps_its_prior(fitted):
    known = priors_of(Vehicle()).believed
    for name in ("yaw_torque.k_m", "motor_lag.tau_up_s", "inertia.inertia_kg_m2[2]"):
        found = fitted.parameters[name]
        assert found.prior_share == 1.0
        assert found.ci_why.startswith("prior: ")
        assert found.value == pytest.approx(known[name].mean)
        assert found.ci95[0] < found.value < found.ci95[1]
    assert fitted.parameters["thrust_scale.s"].prior_share < 0.1
    assert all(0.0 <= p.prior_share <= 1.0 for p in fitted.parameters.values())


def test_draws_are_vehicles_too(fitted):
    assert fitted.draws.shape[1] == len(fitted.model.names)
    assert (fitted.draws >= fitted.model.lower).all()
    gains = [fitted.model.index(f"motor_imbalance.g[{i}]") for i in range(4)]
    np.testing.assert_allclose(fitted.draws[:, gains].mean(axis=1), 1.0)
    inertia = fitted.draws[:, fitted.model.index("inertia.inertia_kg_m2[0]")]
    assert 0.05 < inertia.std() / inertia.mean() < 0.3


def test_ones_own_prior_is_taken(cases):
    text = ('schema = "nanobench-priors/1"\n[yaw_torque.k_m]\nmean = 0.005\nsd = 0.001\nunit = "m"\n'
            'source = "a torque cell"\n')
    found = fit_vehicle(cases[:1], priors=PriorsFile("mine.toml", text))
    assert found.model.parameters["yaw_torque.k_m"] == 0.005
    assert found.parameters["thrust_scale.s"].ci95 is None
    assert "fewer than 3 flights" in found.parameters["thrust_scale.s"].ci_why


def test_flights_that_disagree_with_a_prior_are_said(cases):
    text = ('schema = "nanobench-priors/1"\n[drag_linear.d]\nmean = [0.2, 0.2, 0.2]\nsd = [1e-3, 1e-3, 1e-3]\n'
            'unit = "N s/m"\nsource = "a large parachute"\n')
    found = fit_vehicle(cases[:1], priors=PriorsFile("mine.toml", text))
    assert any("drag_linear.d[0]" in note and "standard deviations" in note for note in found.notes)


def test_too_little_is_refused(cases):
    with pytest.raises(InputError, match="s of clean flight"):
        fit_vehicle([replace(cases[0], spans=cases[0].spans[:0])])


def test_flights_of_four_seconds_are_enough_where_none_is_longer(cases, fitted):
    short = [replace(case, spans=(Span(4.0, 8.0),)) for case in cases]
    scale = fit_vehicle(short).parameters["thrust_scale.s"].value
    assert scale == pytest.approx(fitted.parameters["thrust_scale.s"].value, rel=0.02)


def test_flights_that_hardly_move_are_said(cases, fitted):
    """Hover: the first seconds of a flight, before its path."""
    def note(found):
        return [text for text in found.notes if "hardly move sideways" in text]

    assert not note(fitted)
    still = [replace(case, spans=(Span(2.0, 8.0),), flight=without_path(case.flight)) for case in cases[:1]]
    assert note(fit_vehicle(still))


def without_path(flight):
    """The flight with its sideways velocity and force scaled to a hundredth."""
    changed = {}
    for name, columns in (("mocap", ("vx", "vy")), ("imu", ("acc_x", "acc_y"))):
        values = flight[name].values.copy()
        values[:, [flight[name].index(column) for column in columns]] *= 0.01
        changed[name] = replace(flight[name], values=values)
    return flight.with_streams(**changed)


def moving(noise_V: float, seed: int = 0, n: int = 6000) -> sums.Signals:
    """Signals of a vehicle with inertia 1.7e-5 kg m^2, damping 2e-5 N m s and air moment -6e-4 N s that turns and moves
    smoothly; the logged voltage has white noise."""
    rng = np.random.default_rng(seed)
    t = sums.GRID_S * np.arange(n)
    rate, velocity = np.zeros((n, 3)), np.zeros((n, 3))
    for axis in (0, 1):
        for frequency in rng.uniform(2.0, 9.0, 12):
            rate[:, axis] += 0.1 * np.sin(2.0 * np.pi * (frequency * t + rng.random()))
        for frequency in rng.uniform(0.1, 0.6, 6):
            velocity[:, axis] += 0.3 * np.sin(2.0 * np.pi * (frequency * t + rng.random()))
    turning = np.gradient(rate, sums.GRID_S, axis=0)
    across = np.stack([velocity[:, 1], -velocity[:, 0]], axis=1)
    moment = 1.7e-5 * turning[:, :2] + 2e-5 * rate[:, :2] - 6e-4 * across
    mixing = np.linalg.pinv(np.array([[1, 1, 1, 1], *np.array(Vehicle().motor_positions_m).T[::-1] * [[1], [-1]]]))
    thrust = np.column_stack([np.full(n, 0.4), moment]) @ mixing.T
    lag_s, keep = 0.08, np.exp(-sums.GRID_S / 0.08)
    command = thrust.copy()
    command[1:] = (thrust[1:] - keep * thrust[:-1]) / (1.0 - keep)
    assert lag_s == 0.08
    volts = np.interp(command, np.polynomial.polynomial.polyval(np.linspace(0.0, 8.0, 4001), CURVE),
                      np.linspace(0.0, 8.0, 4001))
    force = np.column_stack([-0.0155 * velocity[:, :2], np.full(n, 0.4)]) / Vehicle().mass_kg
    return sums.Signals(volts + noise_V * rng.standard_normal(volts.shape), velocity, rate, force)


@pytest.mark.parametrize("noise_V", [0.0, 0.2])
def test_noise_of_the_command_does_not_shrink_what_it_does(noise_V):
    """Errors in variables: the noisy command stands on the left, so that inertia is right with noise, too. The other
    way round, motion on command, the same rows would give an inertia that is far too large."""
    found = sums._of_span(moving(noise_V), Vehicle(), CURVE, 0.08)
    for axis in (0, 1):
        dd, dm, dw, dv, mm = found.turning[axis]
        inertia = (dm - 2e-5 * dw + 6e-4 * dv) / dd
        assert inertia == pytest.approx(1.7e-5, rel=0.08)
        assert found.drag[axis, 1] / found.drag[axis, 0] == pytest.approx(0.0155, rel=0.01)
        vv, vm, vd, vw, _ = found.air[axis]
        assert (vm - 1.7e-5 * vd - 2e-5 * vw) / vv == pytest.approx(-6e-4, rel=0.05)
        if noise_V:
            assert mm / dm > 1.3 * 1.7e-5


def test_the_spread_of_thrust_between_flights_is_of_these_flights_and_a_prior():
    """One flight: the prior. Many flights: theirs, 4 %."""
    assert thrust_spread(np.array([1.1])) == pytest.approx(THRUST_SPREAD)
    many = 1.0 + 0.04 * np.tile([-1.0, 1.0], 200)
    assert thrust_spread(many) == pytest.approx(0.04, rel=0.02)
    assert THRUST_SPREAD < thrust_spread(many[:6]) < 0.04


def test_the_file_states_the_spread_of_thrust(fitted):
    assert "thrust of a single flight = thrust_scale.s +- " in fitted.priors[-1]
    text = dumps(fitted.model, {"thrust_scale.s": "single flights differ by 2.2 % (standard deviation)"})
    (line,) = [line for line in text.splitlines() if line.startswith("s = ")]
    assert line.endswith("# 1; single flights differ by 2.2 % (standard deviation)")
    assert loads(text) == fitted.model

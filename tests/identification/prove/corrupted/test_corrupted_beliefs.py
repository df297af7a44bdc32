"""Wrong beliefs: each can be given, and its truth leads back to the nominal simulator."""

import numpy as np
import pytest

from identification.mismatch.space import space_around
from identification.mismatch.wrench import Wrench
from identification.prove.corrupted.beliefs import BELIEFS, MAPS, NOT_COMPARED, flown_by, truth_of
from nanobench_tools.physics import Model, Vehicle


@pytest.fixture(scope="module")
def flown(nominal, tracks):
    return flown_by(nominal, tracks, np.random.default_rng(0))


def size_of(belief):
    return 1.0 if belief.once else min(4.0 * belief.start, 0.9 * belief.most)


def test_every_term_that_a_diagnosis_asks_for_has_a_belief(nominal):
    assert set(space_around(nominal).terms) - set(MAPS) <= {b.term for b in BELIEFS}
    assert {"thrust curve", "no battery"} <= {b.name for b in BELIEFS}


@pytest.mark.parametrize("belief", BELIEFS, ids=lambda b: b.name)
def test_the_truth_leads_back_to_the_nominal_simulator(belief, nominal, tracks, flown):
    simulator = belief.believe(nominal, size_of(belief), flown)
    effects = truth_of(nominal, simulator, "1", ("flight_1",))
    assert [e.term for e in effects] == [belief.term or "thrust_voltage"]
    wrench = Wrench(tracks)
    force, torque = wrench.model(nominal)
    wrong = wrench.model(simulator)
    assert max(np.abs(wrong[0] - force).max(), np.abs(wrong[1] - torque).max()) > 1e-4 or belief.name == "ground_effect"
    if belief.term in NOT_COMPARED or not belief.term:
        assert effects[0].parameters == {}
        return
    right = {name: p.value for name, p in effects[0].parameters.items()}
    mended = space_around(simulator).model.with_parameters(right)
    for got, wanted in zip(wrench.model(mended), (force, torque), strict=True):
        np.testing.assert_allclose(got, wanted, atol=1e-7)


def test_mass_and_thrust_are_twins(nominal, flown):
    mass = next(b for b in BELIEFS if b.name == "mass").believe(nominal, 0.25, flown)
    assert mass.vehicle.mass_kg == pytest.approx(nominal.vehicle.mass_kg / 1.25)
    (effect,) = truth_of(nominal, mass, "3", ("flight_1",))
    assert effect.twins == ("thrust_scale",)
    assert effect.parameters["mass.m"].value == nominal.vehicle.mass_kg


def test_a_curve_that_is_too_steep_is_right_in_hover(nominal, flown):
    steep = next(b for b in BELIEFS if b.name == "thrust curve").believe(nominal, 0.5, flown)
    before, after = (np.polynomial.Polynomial(m.values_of("thrust_voltage")["c"]) for m in (nominal, steep))
    hover = next(float(v.real) for v in (before - flown.hover_N).roots() if v.real > 0.0)
    assert after(hover) == pytest.approx(before(hover))
    assert after.deriv()(hover) == pytest.approx(1.5 * before.deriv()(hover))


def test_a_vehicle_gets_the_beliefs_that_its_input_can_show():
    given = Model(Vehicle(input="thrust"), {"drag_linear": {"d": (0.01, 0.01, 0.01)}})
    suits = {b.name for b in BELIEFS if b.suits(given)}
    assert {"mass", "wind", "command_delay"} <= suits
    assert not suits & {"com_offset", "more inertia", "no battery", "thrust curve", "less lag"}


def test_at_one_the_simulator_lacks_the_term(nominal, flown):
    belief = next(b for b in BELIEFS if b.name == "less drag")
    assert "drag_linear" not in belief.believe(nominal, 1.0, flown)
    half = belief.believe(nominal, 0.5, flown).values_of("drag_linear")["d"]
    assert half == pytest.approx(0.5 * np.array(nominal.values_of("drag_linear")["d"]))
    gains = next(b for b in BELIEFS if b.name == "less imbalance").believe(nominal, 0.5, flown)
    assert gains.values_of("motor_imbalance")["g"] == pytest.approx((1.025, 0.975, 1.01, 0.99))

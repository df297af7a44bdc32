"""Vehicles of other numbers of rotors and of other masses than 40 g: what is hidden is found, what is right is left."""

from __future__ import annotations

import pytest
from many_rotors import flights_of, model_of, vehicle_of

from identification.mismatch.diagnosis import recorded
from identification.mismatch.posterior.posterior_engine import diagnose_flights
from identification.mismatch.size import growth, heavier, wider
from identification.mismatch.space import scales, space_around
from nanobench_tools.errors import InputError
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.model import find_term

HEXA = model_of(6)


@pytest.fixture(scope="module")
def flights():
    return flights_of(HEXA, seconds=10.0)


def terms_of(verdict: dict) -> list[str]:
    return [f["term"] for f in verdict["findings"]]


@pytest.mark.slow
def test_a_right_hexarotor_is_left_alone(flights):
    verdict = diagnose_flights(flights, HEXA)
    assert (verdict["outcome"], verdict["findings"]) == ("none", [])


@pytest.mark.slow
def test_hidden_drag_of_a_hexarotor_is_named(flights):
    mass = HEXA.vehicle.mass_kg
    verdict = diagnose_flights(flights, HEXA.with_term("drag_linear", d=(0.1 * mass, 0.1 * mass, 0.15 * mass)))
    assert terms_of(verdict) == ["drag_linear"]
    found = verdict["findings"][0]["parameters"]["drag_linear.d[0]"]
    assert found["ci95"][0] < 0.4 * mass < found["ci95"][1]
    after, before = (verdict["improvement"]["50"][k]["position_m"] for k in ("after", "before"))
    assert after < 0.7 * before


@pytest.mark.slow
def test_a_weak_motor_of_six_is_named():
    true = HEXA.with_term("motor_imbalance", g=(1.02, 1.02, 0.9, 1.02, 1.02, 1.02))
    verdict = diagnose_flights(flights_of(true, seconds=15.0), HEXA)
    assert {"motor_imbalance", "com_offset"} == {verdict["findings"][0]["term"], *verdict["findings"][0]["equivalent"]}


@pytest.mark.slow
@pytest.mark.parametrize(("rotors", "mass_kg", "arm_m"), [(3, 0.03, 0.05), (8, 5.0, 0.5)])
def test_hidden_mass_of_other_vehicles(rotors, mass_kg, arm_m):
    true = model_of(rotors, mass_kg, arm_m)
    verdict = diagnose_flights(flights_of(true, 3, seconds=8.0), true.on(mass_kg=0.93 * mass_kg))
    finding = verdict["findings"][0]
    assert "mass" in (finding["term"], *finding["equivalent"])
    assert len(verdict["findings"]) == 1


def test_a_recording_of_another_number_of_motors_is_one_line(flights):
    with pytest.raises(InputError, match="has 6 motors, m1 to m6, and the simulator 4 rotors"):
        recorded(flights, False, Vehicle())
    quad = model_of(4)
    with pytest.raises(InputError, match="has 4 motors, m1 to m4, and the simulator 6 rotors") as error:
        diagnose_flights(flights_of(quad, flights=1, seconds=3.0), HEXA)
    assert "\n" not in str(error.value)


def parameter(term, name):
    return next(p for p in find_term(term).parameters if p.name == name)


def test_scales_and_tolerances_grow_with_the_vehicle():
    small, large = Vehicle(mass_kg=0.03), vehicle_of(6, 4.085, 0.0325 * 2**0.5 * 8.0)
    assert (heavier(small), wider(small)) == (1.0, 1.0)
    assert heavier(large) == pytest.approx(100.0)
    assert wider(large) == pytest.approx(8.0, rel=1e-4)
    model = Model(large, {"thrust_pwm": {"c": (0.0, 10.0, 10.0)}, "thrust_rpm": {"k_f": 2.3e-8 / 1.5}})
    assert growth(model, parameter("force_world", "f_N")) == pytest.approx(100.0)
    assert growth(model, parameter("frame_tilt", "roll_rad")) == 1.0
    assert growth(model, parameter("drag_rotor", "d")) == pytest.approx(100.0 / 15.0)


@pytest.mark.parametrize("mass_kg", [0.03, 0.0349, 0.04085, 0.046])
def test_scales_of_vehicles_of_40_g_are_the_typical_ones(mass_kg):
    model = space_around(Model(Vehicle(mass_kg=mass_kg), {"thrust_voltage": {"c": (0.0, 0.005, 0.01)}})).model
    sizes = dict(zip(model.names, scales(model), strict=True))
    assert sizes["force_world.f_N[0]"] == min(1.0, 0.05 * 10.0)
    assert sizes["drag_linear.d[0]"] == find_term("drag_linear").parameter("d").typical[0]
    assert sizes["com_offset.r_m[0]"] == 0.05 * 0.1

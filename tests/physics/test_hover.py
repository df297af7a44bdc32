"""Where models hover and how they turn, against numbers worked out by hand."""

import numpy as np
import pytest

from nanobench_tools.errors import UsageError
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.hover import doubts, hover

K, K_M = 2.5e-8, 0.0065
VEHICLE = Vehicle(mass_kg=0.04, inertia_kg_m2=(1.6e-5, 1.8e-5, 3e-5), input="rpm")
MODEL = Model(VEHICLE, {"thrust_rpm": {"k_f": K}, "yaw_torque": {"k_m": K_M}})


def test_rotor_speeds_by_hand():
    """4 k w^2 = m g; one per cent of w is two of a quarter of the weight, at the arms."""
    found = hover(MODEL)
    weight = 0.04 * VEHICLE.gravity_m_s2
    assert found.motor == pytest.approx([np.sqrt(weight / 4 / K)] * 4, rel=1e-6)
    assert found.thrust_N == pytest.approx([weight / 4] * 4, rel=1e-6)
    more = 0.02 * weight
    assert found.authority_rad_s2 == pytest.approx(
        [more * 0.0325 / 1.6e-5, more * 0.0325 / 1.8e-5, K_M * more / 3e-5], rel=1e-6)
    assert found.unit == "rad/s"


def test_a_centre_of_mass_in_front_is_carried_by_the_motors_in_front():
    found = hover(MODEL.with_term("com_offset", r_m=(0.002, 0.0, 0.0)))
    front, back = found.thrust_N[0] + found.thrust_N[3], found.thrust_N[1] + found.thrust_N[2]
    weight = 0.04 * VEHICLE.gravity_m_s2
    assert front + back == pytest.approx(weight, rel=1e-6)
    assert (front - back) * 0.0325 == pytest.approx(weight * 0.002, rel=1e-3)


def test_wind_is_leant_against():
    """Drag pushes along x; the vehicle leans its thrust against it: a negative turn about y."""
    windy = MODEL.with_term("drag_linear", d=(0.02, 0.02, 0.0)).with_term("wind", w_m_s=(1.0, 0.0, 0.0))
    found = hover(windy)
    assert np.tan(np.radians(found.pitch_deg)) < 0.0
    lean = np.radians(found.pitch_deg)
    assert sum(found.thrust_N) * np.sin(-lean) == pytest.approx(0.02 * np.cos(lean) ** 2, rel=0.05)


@pytest.mark.parametrize("delay_s", [0.0, 0.035])
def test_a_delay_moves_no_hover(delay_s):
    late = MODEL.with_term("command_delay", delay_s=delay_s)
    assert hover(late).motor == pytest.approx(hover(MODEL).motor, rel=1e-9)


def test_a_vehicle_too_heavy_for_its_motors_does_not_hover():
    heavy = Model(Vehicle(mass_kg=1.0), {"thrust_pwm": {"c": (0.0, 0.15)}, "saturation": {"u_max": 1.0}})
    with pytest.raises(UsageError, match="hovers at no command"):
        hover(heavy)


def test_a_yaw_that_no_propeller_has_is_doubted_and_a_larger_vehicle_is_not():
    assert doubts(MODEL) == []
    line, = doubts(MODEL.with_parameters({"yaw_torque.k_m": 1.2e-5}))
    assert "yaw_torque.k_m" in line
    assert "no vehicle" in line
    large = VEHICLE.motor_positions_m
    assert doubts(MODEL.on(motor_positions_m=tuple((20 * x, 20 * y) for x, y in large)).with_parameters(
        {"yaw_torque.k_m": 0.06})) == []

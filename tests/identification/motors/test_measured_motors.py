"""Rotor speed shows lag and inertia of a made vehicle whose constants are known."""

import pytest
from made_logs import INERTIA, MASS, flight, fly

from identification.vehicle.measured_motors import measured_motors
from nanobench_tools.flight import Span
from nanobench_tools.physics.vehicle import sized
from nanobench_tools.protocols.task1 import Case


@pytest.fixture(scope="module")
def cases():
    return [Case(flight(log, f"made{i}"), [Span(0.0, 4.0)], ("all",))
            for i, log in enumerate(fly(3, up_s=0.03, down_s=0.06, noise=3.0))]


def test_rotor_speed_shows_lag_and_inertia(cases):
    found = measured_motors(cases, sized(MASS))
    for name, truth in {"motor_lag.tau_up_s": 0.03, "motor_lag.tau_down_s": 0.06,
                        "inertia.inertia_kg_m2[0]": INERTIA[0], "inertia.inertia_kg_m2[1]": INERTIA[1]}.items():
        assert found[name].value == pytest.approx(truth, rel=0.07), name
        assert 0.0 < found[name].sd < 0.2 * truth, name
        assert abs(found[name].value - truth) < 2.0 * found[name].sd, name


def test_without_rotor_speed_the_motors_are_not_measured(cases):
    alone = [Case(case.flight.without_streams("rpm"), case.spans, case.groups) for case in cases]
    assert measured_motors(alone, sized(MASS)) == {}

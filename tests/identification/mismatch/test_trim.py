"""The steady trim of a flight: hand-worked flights, what is missing, what cannot be told."""

from __future__ import annotations

import numpy as np
import pytest
from hover_flights import HOVER_N, hover

from identification.mismatch.steady.periodic import swing_in, swing_of
from identification.mismatch.steady.reconstruct import states_of
from identification.mismatch.steady.trim import Trim, runs_of, trim_of
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, make_stream
from nanobench_tools.results.result import to_json


def trim(flight: Flight) -> Trim:
    return trim_of(flight, audit(flight))


def test_thrust_asked_of_each_motor_is_found():
    asked = np.array([0.1, -0.05, 0.2, 0.0])
    found = trim(hover("a", asked))
    assert found.gains == pytest.approx(np.log(HOVER_N) + asked, abs=0.002)
    assert found.known_lift
    assert found.seconds > 10.0
    assert found.height_m == pytest.approx(0.5, abs=0.02)
    assert np.all(found.sd["gains"] < 0.003)


def test_climbing_and_another_battery_change_nothing():
    quiet, lively = trim(hover("a")), trim(hover("b", climb_m_s2=1.5, battery_V=4.1))
    assert lively.gains == pytest.approx(quiet.gains, abs=0.005)
    assert lively.battery_V > quiet.battery_V + 0.3


def test_sensors_that_are_askew_and_wind_are_told_apart():
    askew, blown = trim(hover("a", felt=(0.2, -0.1))), trim(hover("b", push_left=0.4))
    assert askew.level == pytest.approx([0.2, -0.1], abs=0.02)
    assert askew.push[1] == pytest.approx(0.0, abs=0.03)
    assert blown.push[1] == pytest.approx(0.4, abs=0.03)
    assert blown.level == pytest.approx([0.0, 0.0], abs=0.02)
    assert np.isnan(askew.push[0])  # no pitch was logged


def test_a_battery_that_stands_still_leaves_shares():
    found = trim(hover("a", (0.0, 0.0, 0.1, 0.0), battery_V=None))
    assert not found.known_lift
    assert np.isnan(found.battery_V)
    assert any("is constant" in note for note in found.notes)


def test_json_keeps_everything():
    found = trim(hover("a"))
    again = Trim.from_json(found.to_json())
    assert again.gains == pytest.approx(found.gains)
    assert again.known_lift == found.known_lift
    assert np.isnan(again.push[0])
    assert again.notes == found.notes


def test_what_has_no_trim_says_why():
    with pytest.raises(InputError, match="never left the ground"):
        trim(hover("a", on=False))
    flight = hover("a")
    with pytest.raises(InputError, match="motor commands are not among its variables"):
        trim(flight.without_streams("motor"))
    full = flight["motor"]
    stuck = make_stream("motor", full.time_s, np.where(full.values > 0.0, 1.0, 0.0), full.quantities)
    with pytest.raises(InputError, match="full command"):
        trim(flight.with_streams(motor=stuck))


def swing(flight: Flight):
    states = states_of(flight)
    return swing_in(states, runs_of(flight, audit(flight), flight["motor"].values, states.time_s))


def test_a_swing_is_found_with_its_frequency_and_only_there():
    normal = [swing(hover(f"n{k}", seed=k)) for k in range(4)]
    still = [swing(hover(f"s{k}", seed=10 + k)) for k in range(3)]
    hung = [swing(hover(f"h{k}", seed=20 + k, swing=(0.1, 0.65))) for k in range(3)]
    assert swing_of(still, normal) is None
    found = swing_of(hung, normal)
    assert found is not None
    assert found["frequency_hz"] == pytest.approx(0.65, abs=0.06)
    assert found["direction_deg"] is None  # no pitch: what goes ahead and back cannot be seen
    assert found["axes"] == ["left"]


def test_the_course_of_a_trim_shows_it_second_by_second_and_survives_json():
    asked = np.array([0.1, -0.05, 0.2, 0.0])
    found = trim(hover("a", asked))
    course = np.array(found.course)
    assert course.shape[0] >= 10
    assert np.diff(course[:, 0]) == pytest.approx(1.0)
    assert course[:, 3:] == pytest.approx(np.broadcast_to(np.log(HOVER_N) + asked, (len(course), 4)), abs=0.02)
    again = Trim.from_json(to_json(found.to_json()))
    np.testing.assert_allclose(np.array(again.course), course)

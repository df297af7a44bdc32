"""A collective command and the measured attitude: only translation is asked, and nothing that turns gets a name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from many_rotors import flights_of, model_of

from identification.mismatch.along import paths
from identification.mismatch.believe import beliefs
from identification.mismatch.commanded import UNASKED, believed, turning, with_attitude
from identification.mismatch.diagnosis import recorded
from identification.mismatch.posterior.posterior_engine import diagnose_flights
from identification.mismatch.recordings import Recordings
from identification.mismatch.track import Track
from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.flight import make_stream
from nanobench_tools.physics import Model, numeric
from nanobench_tools.physics.inputs import settled

MASS_KG = 1.2
QUAD = model_of(4, MASS_KG, 0.2)


@pytest.fixture(scope="module", params=["1", pytest.param("N", marks=pytest.mark.slow)])
def flights(request):
    return flights_of(QUAD, command=request.param, seconds=10.0)


@pytest.fixture(scope="module")
def newtons():
    return flights_of(QUAD, command="N", seconds=10.0)


def in_parts(flight, name: str, quantities: tuple[str, ...], values: np.ndarray):
    """The flight with its attitude in a stream of its own."""
    mocap = flight["mocap"]
    return flight.with_streams(
        mocap=make_stream("mocap", mocap.time_s, mocap["px", "py", "pz"], ("px", "py", "pz")),
        **{name: make_stream(name, mocap.time_s, values, quantities)})


def test_a_right_simulator_is_left_alone_and_what_was_not_asked_is_said(flights):
    verdict = diagnose_flights(flights, QUAD)
    assert (verdict["outcome"], verdict["findings"]) == ("none", [])
    assert not set(verdict["power"]) & set(UNASKED)
    assert {"drag_linear", "mass", "motor_lag"} <= set(verdict["power"])
    assert [e["term"] for e in verdict["not_asked"]] == [
        "angular_damping", "com_offset", "drag_torque", "inertia", "motor_imbalance", "rotor_gyro",
            "rotor_reaction", "yaw_torque"]
    assert {e["why"] for e in verdict["not_asked"]} == {"not tested: no motor commands"}
    assert "Only translation was checked" in verdict["paragraph"]


@pytest.mark.slow
def test_hidden_drag_is_named_and_predicts_the_path_of_flights_left_out(flights):
    verdict = diagnose_flights(flights, QUAD.with_term("drag_linear", d=tuple(MASS_KG * k for k in (0.1, 0.1, 0.15))))
    finding, = verdict["findings"]
    assert finding["term"] == "drag_linear"
    low, high = finding["parameters"]["drag_linear.d[0]"]["ci95"]
    assert low < 0.4 * MASS_KG < high
    entry = verdict["improvement"]["50"]
    assert entry["after"]["position_m"] < 0.3 * entry["before"]["position_m"]
    assert entry["after"]["velocity_m_s"] < 0.3 * entry["before"]["velocity_m_s"]
    for side in ("before", "after", "floor"):
        assert entry[side]["attitude_rad"] is None
        assert entry[side]["rate_rad_s"] is None
    assert len(verdict["improvement"]["held_out"]) == 3
    assert "the measured attitude given" in verdict["paragraph"]


@pytest.mark.slow
def test_hidden_mass_is_named(newtons):
    verdict = diagnose_flights(newtons, QUAD.on(mass_kg=1.1))
    finding, = verdict["findings"]
    assert "mass" in (finding["term"], *finding["equivalent"])


@pytest.mark.parametrize("hidden", [
    {"com_offset": {"r_m": (0.01, -0.01, 0.0)}},
    pytest.param({"inertia": {"inertia_kg_m2": (0.03, 0.03, 0.06)}}, marks=pytest.mark.slow),
    pytest.param({"yaw_torque": {"k_m": 0.06}}, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_what_only_turns_gets_no_name(newtons, hidden):
    """The simulator believes it, the vehicle has none of it."""
    name, values = next(iter(hidden.items()))
    verdict = diagnose_flights(newtons, QUAD.with_term(name, **values))
    assert verdict["findings"] == []
    assert verdict["outcome"] in ("none", "unknown")


def test_attitude_may_stand_in_a_stream_of_its_own(newtons):
    q = newtons[0]["mocap"]["qx", "qy", "qz", "qw"]
    apart = in_parts(newtons[0], "attitude_qw", ("qx", "qy", "qz", "qw"), q)
    angles = in_parts(newtons[0], "attitude", ("roll", "pitch", "yaw"), so3.euler_zyx(q))
    for flight in (apart, angles):
        found = with_attitude(flight)["mocap"]["qx", "qy", "qz", "qw"]
        assert so3.geodesic_angle(found, q).max() < 1e-7
        assert recorded([flight], False, QUAD.vehicle).judged_s > 8.0


def test_without_attitude_it_is_one_line(newtons):
    blind = [in_parts(f, "setpoint", ("x",), np.zeros((len(f["mocap"]), 1))) for f in newtons]
    with pytest.raises(InputError, match="no attitude with its position") as error:
        diagnose_flights(blind, QUAD)
    assert "\n" not in str(error.value)


def test_what_a_simulator_believes_is_asked_of_motors_and_why_not_is_said(newtons):
    with pytest.raises(InputError, match="a collective command and no motor commands; give --simulator"):
        beliefs(Recordings((newtons[0],), {}, (), (), {}))
    with pytest.raises(InputError, match=r"0 s of clean flight \(a: no battery stream\); give at least"):
        beliefs(Recordings((), {}, (), (), {"a": "no battery stream"}))


def test_recordings_in_different_units_are_refused(newtons):
    command = newtons[0]["command"]
    other = newtons[0].with_streams(command=replace(command, unit=("N",) if command.unit == ("1",) else ("1",)))
    with pytest.raises(InputError, match="another unit"):
        recorded([replace(other, name="other"), newtons[1]], False, QUAD.vehicle)


@pytest.mark.slow
def test_motor_commands_win_over_a_collective_one():
    flight = flights_of(QUAD, 1, seconds=10.0)[0]
    command = make_stream("command", flight["mocap"].time_s, np.full((len(flight["mocap"]), 1), 0.5), ("thrust",))
    found = recorded([flight.with_streams(command=command)], False, QUAD.vehicle)
    assert {t.commanded for t in found.tracks} == {""}
    np.testing.assert_allclose(found.tracks[0].motor[100], flight["motor"].values[100], atol=0.02)


def test_a_simulator_of_newtons_has_no_map():
    newton = believed(QUAD.with_term("saturation", u_max=0.9), "N")
    assert newton.vehicle.input == "thrust"
    assert "thrust_pwm" not in newton
    assert "saturation" not in newton
    assert believed(newton, "N") == newton
    command = settled(newton, np.array([1.0, 2.0, 3.0, 4.0, 0.0])[:, None], row_hz=100.0)
    np.testing.assert_array_equal(command.ravel(), [1.0, 2.0, 3.0, 4.0])
    with pytest.raises(InputError, match="as a share of full"):
        believed(newton, "1")
    with pytest.raises(InputError, match="recordings hold motor commands"):
        believed(newton, "")
    with pytest.raises(InputError, match="input is thrust, in N already"):
        Model(newton.vehicle, QUAD.as_dict())


def test_a_path_along_the_attitude_is_the_one_that_was_flown():
    """Against the Runge-Kutta 4 of the whole vehicle, which turns by its motors."""
    rng = np.random.default_rng(3)
    n, past = 160, 50
    motor = 0.5 + 0.02 * rng.standard_normal((1, n, 1)) + 0.0005 * rng.standard_normal((1, n, 4))
    volts = np.full((1, n), 3.8)
    start = np.array([[0.0, 0.0, 2.0, 0.5, -0.3, 0.2, 0.0, 0.0, 0.0, 1.0, 0.05, -0.04, 0.1]])
    states = numeric.rollout(QUAD, start, motor, volts, row_hz=100.0)[0, :-1]
    none = np.zeros((n, 3))
    track = Track("flown", 0, 0.01 * np.arange(n), states[:, 0:3], states[:, 3:6], states[:, 6:10], states[:, 10:13],
                  none, motor[0], volts[0], np.ones(n, bool), none[:, 0], none[:, :2], "1")
    found = paths(QUAD, track, np.array([60, 100]), 50, past)
    assert np.ptp(states[60:, 3]) > 0.01
    for k, s in enumerate((60, 100)):
        np.testing.assert_allclose(found[k, :, 0:6], states[s:s + 51, 0:6], atol=2e-4)


def test_the_rate_of_an_attitude():
    t = 0.01 * np.arange(300)
    rate = np.stack([0.3 * np.sin(t), 0.2 * np.cos(2.0 * t), 0.4 + 0.0 * t], axis=1)
    q = np.zeros((300, 4))
    q[0, 3] = 1.0
    for k in range(299):
        q[k + 1] = so3.multiply(q[k], so3.exp(0.01 * 0.5 * (rate[k] + rate[k + 1])))
    np.testing.assert_allclose(turning(q, 0.01)[10:-10], rate[10:-10], atol=2e-3)

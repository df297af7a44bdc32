"""SYNTHETIC: a simulator that takes rotor speeds is judged by the speeds that were measured, whatever was commanded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from many_rotors import flights_of, model_of

from identification.mismatch.diagnosis import recorded
from identification.mismatch.measured_speed import of_speed, with_speed
from identification.mismatch.posterior.posterior_engine import diagnose_flights
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Fault, make_stream
from nanobench_tools.physics import Model

FLOWN = model_of(4, 1.2, 0.2, motor_lag={"tau_up_s": 0.0, "tau_down_s": 0.0})
K_F = 4e-6
SIMULATOR = Model(replace(FLOWN.vehicle, input="rpm"), {
    "thrust_rpm": {"k_f": K_F}, **{n: FLOWN.values_of(n) for n in ("yaw_torque", "drag_linear")}})


def turning(flight):
    """With the rotor speeds that its commands made, and then commands that say something else."""
    motor = flight["motor"]
    c, u = FLOWN.values_of("thrust_pwm")["c"], motor.values
    speed = np.sqrt((c[1] * u + c[2] * u**2) / K_F)
    return flight.with_streams(rpm=make_stream("rpm", motor.time_s, speed, motor.quantities),
                               motor=replace(motor, values=0.3 + 0.2 * u[:, ::-1]))


@pytest.fixture(scope="module")
def flights():
    return [turning(f) for f in flights_of(FLOWN, seconds=10.0)]


@pytest.mark.slow
def test_speeds_are_what_a_simulator_of_speeds_is_given(flights):
    verdict = diagnose_flights(flights, SIMULATOR)
    assert (verdict["outcome"], verdict["findings"]) == ("none", [])


@pytest.mark.slow
def test_hidden_drag_is_named(flights):
    verdict = diagnose_flights(flights, SIMULATOR.with_term("drag_linear", d=(0.12, 0.12, 0.18)))
    finding, = verdict["findings"]
    assert finding["term"] == "drag_linear"
    low, high = finding["parameters"]["drag_linear.d[0]"]["ci95"]
    assert low < 0.4 * 1.2 < high


def test_without_speeds_it_is_one_line(flights):
    with pytest.raises(InputError, match=r"no measured rotor speed.*takes rotor speeds"):
        diagnose_flights([f.without_streams("rpm") for f in flights], SIMULATOR)


def test_a_flight_without_speeds_is_left_out_by_its_reason(flights):
    recordings = recorded([flights[0], flights[1].without_streams("rpm")], False, SIMULATOR.vehicle)
    assert recordings.left_out == {"flight_2": "no rpm stream"}


def test_a_sensor_that_reads_nothing_is_not_judged(flights):
    stream = flights[0]["rpm"]
    dead = np.where((stream.time_s[:, None] > 4.0) & (np.arange(4) == 2), 0.0, stream.values)
    broken = flights[0].with_streams(rpm=replace(stream, values=dead), motor=replace(
        flights[0]["motor"], values=0.3 + 0.2 * stream.values / stream.values.max()))
    (track,) = recorded([broken], False, SIMULATOR.vehicle).tracks
    assert 1.0 < track.time_s[track.counts].max() < 4.0


def test_faults_of_the_speeds_count_and_those_of_the_commands_do_not(flights):
    seen = audit(flights[0])
    with_faults = replace(seen, faults=(Fault("gap", "rpm", (), 2.0, 3.0, 1.0, "s", ""),
                                        Fault("gap", "motor", (), 5.0, 6.0, 1.0, "s", "")))
    assert [(f.stream, f.start_s) for f in of_speed(with_faults).faults] == [("motor", 2.0)]
    assert "motor" not in with_speed(flights[0].without_streams("rpm"))

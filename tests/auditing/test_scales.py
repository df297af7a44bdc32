"""Scales of motors, rotors and paths: found where no vehicle has them, else listed as unchecked."""

from dataclasses import replace

import numpy as np
import pytest
from one_kind import faults_of

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.flight import Flight, Provenance, make_stream

MOTORS = ("m1", "m2", "m3", "m4")
POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")


@pytest.fixture(scope="module")
def flown(crowd):
    return crowd.log("fast figure_eight")[0]


def told(flight, stream):
    return {f.kind: f.evidence for f in faults_of(flight, "unit", "sign") if f.stream == stream}


def rescaled(flight, change, name="motor"):
    motor = flight["motor"]
    made = make_stream(name, motor.time_s, change(motor[MOTORS]), MOTORS, rate_hz=motor.rate_hz)
    return flight.with_streams(**{name: made})


@pytest.mark.parametrize("full", [100.0, 255.0, 1000.0])
def test_commands_that_were_read_as_16_bits_cannot_carry_a_flight(flown, full):
    assert "never exceed" in told(rescaled(flown, lambda v: v * full / 65535.0), "motor")["unit"]


def test_commands_that_carried_the_flight_are_no_finding(flown):
    assert told(flown, "motor") == {}


def test_commands_from_minus_one_are_no_shares_of_full(flown):
    assert "a command is 0 to 1" in told(rescaled(flown, lambda v: 2.0 * v - 1.0), "motor")["unit"]


@pytest.mark.parametrize("name", ["motor_request", "rpm"])
def test_negative_requests_and_speeds_are_negated(flown, name):
    assert "below 0 in most rows" in told(rescaled(flown, lambda v: -2000.0**(name == "rpm") * v, name), name)["sign"]


@pytest.mark.parametrize(("rad_s", "what"), [(2000.0, ""), (2000.0 / 60.0, "per second"), (12000.0 * 2, "electrical")])
def test_rotors_turn_as_those_of_a_vehicle(flown, rad_s, what):
    found = told(rescaled(flown, lambda v: rad_s * np.sqrt(np.maximum(v, 0.0)), "rpm"), "rpm").get("unit", "")
    assert what in found
    assert bool(found) == bool(what)


@pytest.mark.parametrize("faster", [0.5, 1.0, 2.0])
def test_a_frame_rate_that_is_wrong_by_two_contradicts_the_tilt(flown, faster):
    poses = flown["mocap"]
    mocap = make_stream("mocap", poses.time_s / faster, poses[POSE], POSE, rate_hz=poses.rate_hz * faster)
    found = told(Flight("poses", {"mocap": mocap}, {}, Provenance("made", "", "test")), "mocap").get("unit", "")
    assert ("times are" in found) == (faster != 1.0)
    assert faster == 1.0 or "px, py accelerates" in found


def test_scales_that_nothing_shows_are_listed(flown):
    listed = audit(flown).unchecked
    assert "scale of m1, m2, m3, m4 (motor)" in listed
    assert "scale of vbat (battery)" in listed
    assert not any("(mocap)" in entry for entry in listed)
    poses = flown["mocap"]
    path = make_stream("mocap", poses.time_s, poses[POSE[:3]], POSE[:3], rate_hz=poses.rate_hz)
    assert "scale of px, py, pz, t (mocap)" in audit(
        Flight("path", {"mocap": path}, {}, Provenance("made", "", "test"))).unchecked


def test_a_log_without_x_flew_as_one_with_it(flown):
    """Switched on in the air: that the vehicle moves shows the flight, whichever axes were logged."""
    air = audit(flown).airborne[0]
    rows = {name: s.rows((s.time_s > air.start_s + 3.0) & (s.time_s < air.end_s - 3.0)) for name, s in
            flown.streams.items() if name in ("estimator", "motor")}
    high = rows["estimator"]
    level = high.values.copy()
    level[:, high.index("z")] = 1.0 + 0.01 * np.sin(high.time_s)
    for left_out in ("", "x", "y"):
        kept = [k for k, q in enumerate(high.quantities) if q != left_out and q in ("x", "y", "z")]
        lone = replace(high, values=level[:, kept], columns=tuple(high.columns[k] for k in kept),
                       quantities=tuple(high.quantities[k] for k in kept), unit=tuple(high.unit[k] for k in kept))
        found = audit(Flight("air", {"estimator": lone, "motor": rows["motor"]}, {}, Provenance("made", "", "test")))
        assert "never_flew" not in {f.kind for f in found.faults}, left_out
        assert len(found.airborne) == 1


def test_an_axis_that_hardly_moves_is_not_confirmed_by_the_other(flown):
    """The path goes along y; that of x is smaller than the tilt shows."""
    t = np.arange(0.0, 12.0, 0.01)
    rise = np.clip(np.minimum(t - 1.0, 11.0 - t), 0.0, 1.0)
    y = 0.5 * np.sin(2.5 * t) * rise
    tilt = np.gradient(np.gradient(y, t), t) / 9.81
    noise = 1e-3 * np.random.default_rng(3).standard_normal((len(t), 3))
    q = np.column_stack([-tilt / 2.0, np.zeros((len(t), 2)), np.ones(len(t))])
    q += np.column_stack([noise, np.zeros(len(t))])
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    mocap = make_stream("mocap", t, np.column_stack([0.3 * noise[:, 0], y, rise + 0.3 * noise[:, 2], q]), POSE)
    (entry,) = (e for e in audit(Flight("line", {"mocap": mocap}, {}, Provenance("made", "", "test"))).unchecked
                if e.startswith("sign"))
    assert "px" in entry
    assert "py" not in entry

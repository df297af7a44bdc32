"""PX4 logs against cases worked by hand; the files are packed by struct from the description of the format."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
from ulog_samples import MAGIC, times, ulog, yaw_right_of_north

from nanobench_tools import so3
from nanobench_tools.errors import how_to_install
from nanobench_tools.sources import load_recordings
from nanobench_tools.sources.ulog import Px4Log

T = times()
REST = [(t, 0.0, 0.0, 0.0, 0.0, 0.0, -9.81) for t in T]


def flight_of(tmp_path, topics, parameters=None):
    (tmp_path / "somewhere.bin").write_bytes(ulog(topics, parameters))
    loaded = load_recordings([tmp_path], cache=False)
    assert loaded.failed == []
    assert loaded.flights[0].provenance.source == "ulog"
    return loaded.flights[0]


def position(t, x=0.0, y=0.0, z=0.0, v=(0.0, 0.0, 0.0), valid=True):
    return (t, valid, True, valid, True, x, y, z, *v, 0.0, 0.0, 0.0)


def test_level_vehicle_at_rest(tmp_path):
    flight = flight_of(tmp_path, {"sensor_combined": REST, "battery_status": [(t, 16.2) for t in T]})
    np.testing.assert_allclose(flight["imu"]["acc_x", "acc_y", "acc_z"], [[0.0, 0.0, 9.81]] * 20, rtol=1e-6)
    np.testing.assert_allclose(flight["imu"].time_s, 0.01 * np.arange(20), atol=1e-12)
    assert flight["imu"].rate_hz == pytest.approx(100.0)
    assert flight["battery"]["vbat"] == pytest.approx([16.2] * 20)
    assert flight.epoch_s == pytest.approx(5.0)
    assert flight.provenance.findings == ()
    assert any("only the vehicle's own estimate" in n for n in flight.provenance.notes)


def test_signs_of_the_gyro(tmp_path):
    """Roll to the right stays positive; nose up is negative about y-left; a turn to the right is negative about up."""
    flight = flight_of(tmp_path, {"sensor_combined": [(t, 0.1, 0.2, 0.3, 0.0, 0.0, -9.81) for t in T]})
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], [[0.1, -0.2, -0.3]] * 20, rtol=1e-6)


def test_climb_and_horizontal_axes(tmp_path):
    """North 1 m, east 2 m, climbing at 0.5 m/s."""
    rows = [position(t, 1.0, 2.0, -0.5e-6 * (t - T[0]), (0.1, 0.2, -0.5)) for t in T]
    flight = flight_of(tmp_path, {"vehicle_local_position": rows})
    estimator = flight["estimator"]
    np.testing.assert_allclose(estimator["x", "y"], [[2.0, 1.0]] * 20)
    np.testing.assert_allclose(np.diff(estimator["z"]), 0.005, rtol=1e-4)
    np.testing.assert_allclose(estimator["vx", "vy", "vz"], [[0.2, 0.1, 0.5]] * 20, rtol=1e-6)
    assert estimator.columns[:3] == tuple(f"vehicle_local_position.{a}" for a in "yxz")


@pytest.mark.parametrize(("right_of_north", "yaw"), [(0.0, 90.0), (90.0, 0.0), (180.0, -90.0), (-30.0, 120.0)])
def test_yaw(tmp_path, right_of_north, yaw):
    q = yaw_right_of_north(math.radians(right_of_north))
    flight = flight_of(tmp_path, {"vehicle_attitude": [(t, t, *q) for t in T]})
    got = flight["attitude_qw"]["qx", "qy", "qz", "qw"]
    expected = so3.from_euler_zyx(0.0, 0.0, math.radians(yaw))
    np.testing.assert_allclose(np.abs(got @ expected), 1.0, atol=1e-6)
    np.testing.assert_allclose(np.degrees(flight["attitude"]["yaw"]), yaw, atol=1e-3)


def test_tilt_agrees_with_what_gravity_says(tmp_path):
    """Nose up by 0.3 rad, rolled right by 0.2 (NED, ZYX): turned by our attitude, the measured force points up."""
    roll, pitch, yaw = 0.2, 0.3, 0.7
    x, y, z, w = so3.from_euler_zyx(roll, pitch, yaw)
    down = so3.rotate_inverse(np.array([x, y, z, w]), np.array([0.0, 0.0, 9.81]))
    flight = flight_of(
        tmp_path,
        {"vehicle_attitude": [(t, t, w, x, y, z) for t in T], "sensor_combined": [(t, 0, 0, 0, *-down) for t in T]},
    )
    q = flight["attitude_qw"]["qx", "qy", "qz", "qw"]
    up = so3.rotate(q, flight["imu"]["acc_x", "acc_y", "acc_z"])
    np.testing.assert_allclose(up, [[0.0, 0.0, 9.81]] * 20, atol=1e-5)
    np.testing.assert_allclose(flight["attitude"]["roll", "pitch"], [[roll, -pitch]] * 20, atol=1e-6)
    assert flight["attitude"]["yaw"] == pytest.approx([math.pi / 2 - yaw] * 20, abs=1e-6)


def test_poses_from_outside_setpoints_and_thrust(tmp_path):
    q, nan = yaw_right_of_north(math.pi / 2), math.nan
    flight = flight_of(
        tmp_path,
        {
            "vehicle_visual_odometry": [(t, 1.0, 2.0, -3.0, *q) for t in T],
            "vehicle_local_position_setpoint": [(t, nan, nan, -2.0, 0.0) for t in T],
            "vehicle_attitude_setpoint": [(t, 0.0, 0.0, -0.4) for t in T],
            "sensor_gps": [(t, 1_772_689_631_000_000 + t) for t in T],
        },
    )
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], [[2.0, 1.0, 3.0]] * 20)
    np.testing.assert_allclose(np.abs(flight["mocap"]["qw"]), 1.0, atol=1e-6)
    assert flight["setpoint"].quantities == ("z", "yaw")
    np.testing.assert_allclose(flight["setpoint"]["z", "yaw"], [[2.0, math.pi / 2]] * 20)
    assert flight["command"]["thrust"] == pytest.approx([0.4] * 20)
    assert flight.epoch_s == pytest.approx(1_772_689_631.0 + 5.0)
    assert flight.provenance.findings == ()


def test_the_truth_of_a_simulator_is_the_truth(tmp_path):
    """Position and attitude of the same timestamps are one stream; the odometry of a camera is no truth then."""
    q = yaw_right_of_north(math.pi / 2)
    truth = {"vehicle_local_position_groundtruth": [(t, 1.0, 2.0, -3.0, 0.1, 0.2, -0.3) for t in T],
             "vehicle_visual_odometry": [(t, 9.0, 9.0, -9.0, *q) for t in T]}
    mocap = flight_of(tmp_path, {**truth, "vehicle_attitude_groundtruth": [(t, *q) for t in T]})["mocap"]
    np.testing.assert_allclose(mocap["px", "py", "pz", "vx", "vy", "vz"], [[2.0, 1.0, 3.0, 0.2, 0.1, 0.3]] * 20)
    np.testing.assert_allclose(np.abs(mocap["qw"]), 1.0, atol=1e-6)
    apart = flight_of(tmp_path, {**truth, "vehicle_attitude_groundtruth": [(t + 3000, *q) for t in T]})
    assert "qw" not in apart["mocap"].quantities
    assert any("qx, qy, qz of vehicle_attitude_groundtruth not read" in note for note in apart.provenance.notes)


def test_four_zeros_are_no_attitude(tmp_path):
    flight = flight_of(tmp_path, {"vehicle_visual_odometry": [(t, 0.01 * k, 2.0, -3.0, 0.0, 0.0, 0.0, 0.0)
                                                              for k, t in enumerate(T)]})
    assert flight["mocap"].quantities == ("px", "py", "pz")


def test_increments_are_divided_by_their_interval(tmp_path):
    rows = [(t, 0.01, 0.02, 0.03, 0.0, 0.0, -0.0981, 10_000, 10_000) for t in T]
    imu = flight_of(tmp_path, {"vehicle_imu": rows})["imu"]
    assert imu.quantities == ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")
    np.testing.assert_allclose(imu.values, [[0.0, 0.0, 9.81, 1.0, -2.0, -3.0]] * 20, rtol=1e-6, atol=1e-9)


def test_the_first_instance_is_read_unless_it_ended_early(tmp_path):
    """However often the second one was sent."""
    often = [(t, 7.0) for t in times(n=80, step_us=2_500)]
    assert flight_of(tmp_path, {"battery_status": [(t, 4.0) for t in T], "battery_status:1": often})["battery"][
        "vbat"] == pytest.approx([4.0] * 20)
    assert flight_of(tmp_path, {"battery_status": [(t, 4.0) for t in T[:3]], "battery_status:1": often})["battery"][
        "vbat"] == pytest.approx([7.0] * 80)
    assert flight_of(tmp_path, {"battery_status": [(t, 0.0) for t in T], "battery_status:1": often})["battery"][
        "vbat"] == pytest.approx([7.0] * 80)


def test_time_of_measuring_is_used_where_it_was_logged(tmp_path):
    q = yaw_right_of_north(0.0)
    flight = flight_of(
        tmp_path, {"vehicle_attitude": [(t, t - 3000, *q) for t in T], "sensor_combined": REST}
    )
    np.testing.assert_allclose(flight["imu"].time_s - flight["attitude_qw"].time_s, 0.003, atol=1e-9)


def test_positions_that_are_not_valid_are_none(tmp_path):
    rows = [position(t, 1.0, 2.0, -3.0, valid=i >= 5) for i, t in enumerate(T)]
    estimator = flight_of(tmp_path, {"vehicle_local_position": rows})["estimator"]
    assert np.isnan(estimator["x"]).sum() == 5
    assert np.isfinite(estimator["z"]).all()


CONTROL = (0.1, 0.2, 0.3, 0.4)


def test_motors_of_a_quadrotor_x(tmp_path):
    """PX4: front right, back left, front left, back right; here clockwise from front right."""
    nan = math.nan
    flight = flight_of(
        tmp_path,
        {
            "actuator_motors": [(T[0], *[nan] * 12), *((t, *CONTROL, *[nan] * 8) for t in T[1:])],
            "esc_status": [(t, *(v for i in range(4) for v in (1000 * (i + 1), 101 + i))) for t in T],
        },
    )
    np.testing.assert_allclose(flight["motor"]["m1", "m2", "m3", "m4"][1:], [[0.1, 0.4, 0.2, 0.3]] * 19, rtol=1e-6)
    np.testing.assert_array_equal(flight["motor"].values[0], 0.0)
    rpm = np.array([1000.0, 4000.0, 2000.0, 3000.0]) * 2 * math.pi / 60
    np.testing.assert_allclose(flight["rpm"].values, [rpm] * 20)
    assert any("taken to be PX4's quadrotor X" in n for n in flight.provenance.notes)


def test_geometry_in_the_log_decides_the_order(tmp_path):
    """Rotors counted clockwise from back left; y is to the right."""
    corners = [(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)]
    parameters = {"CA_ROTOR_COUNT": 4}
    for i, (x, y) in enumerate(corners):
        parameters |= {f"CA_ROTOR{i}_PX": x, f"CA_ROTOR{i}_PY": y}
    flight = flight_of(tmp_path, {"actuator_motors": [(t, *CONTROL, *[0.0] * 8) for t in T]}, parameters)
    np.testing.assert_allclose(flight["motor"].values, [[0.3, 0.4, 0.1, 0.2]] * 20, rtol=1e-6)


def test_more_rotors_than_a_motor_stream_holds(tmp_path):
    control = tuple(0.1 * (i + 1) for i in range(6))
    flight = flight_of(
        tmp_path,
        {"actuator_motors": [(t, *control, *[math.nan] * 6) for t in T], "sensor_combined": REST},
        {"CA_ROTOR_COUNT": 6},
    )
    if "motor" in flight:
        np.testing.assert_allclose(flight["motor"].values, [control] * 20, rtol=1e-6)
        return
    np.testing.assert_allclose(flight["extra_motor"].values, [control] * 20, rtol=1e-6)
    (fault,) = flight.provenance.findings
    assert (fault.kind, fault.stream, fault.size, fault.start_s) == ("extra_column", "motor", 6.0, 0.0)
    assert "6 rotors in actuator_motors, a motor stream holds 4" in fault.evidence


@pytest.mark.parametrize(
    ("parameters", "output", "expected"),
    [
        ({}, lambda i: (1000 + i, 1200 + i, 1400 + i, 1600 + i), lambda i: (i, 600 + i, 200 + i, 400 + i)),
        ({"PWM_MIN": 1100, "PWM_MAX": 1900}, lambda i: (1100 + i,) * 4, lambda i: (i / 0.8,) * 4),
        (
            {f"PWM_MAIN_FUNC{k + 1}": 104 - k for k in range(4)},
            lambda i: (1600 + i, 1400 + i, 1200 + i, 1000 + i),
            lambda i: (i, 600 + i, 200 + i, 400 + i),
        ),
    ],
)
def test_pulses(tmp_path, parameters, output, expected):
    rows = [(t, 8, *output(i), *[1500.0] * 4, *[0.0] * 8) for i, t in enumerate(T)]
    flight = flight_of(tmp_path, {"actuator_outputs": rows}, parameters)
    np.testing.assert_allclose(flight["motor"].values, [np.array(expected(i)) / 1000 for i in range(20)], atol=1e-6)


def test_outputs_in_unknown_units_are_not_read(tmp_path):
    rows = [(t, 4, *[40.0 + i] * 4, *[0.0] * 12) for i, t in enumerate(T)]
    flight = flight_of(tmp_path, {"actuator_outputs": rows, "sensor_combined": REST})
    assert "motor" not in flight
    assert any("neither pulses in microseconds nor 0..1" in n for n in flight.provenance.notes)


def test_every_cut_keeps_all_whole_messages(tmp_path):
    whole = ulog({"sensor_combined": REST})
    size = 3 + 2 + 8 + 24
    body = len(whole) - 20 * size
    for end in range(body + size, len(whole) + 1, 5):
        flight = Px4Log().read(tmp_path / "x", whole[:end])
        assert len(flight["imu"]) == (end - body) // size
        kinds = [f.kind for f in flight.provenance.findings]
        assert kinds == ([] if (end - body) % size == 0 else ["truncated"])


def test_noise_inside_a_log_is_reported_and_the_rest_is_read(tmp_path):
    whole = ulog({"sensor_combined": REST})
    size = 3 + 2 + 8 + 24
    body = len(whole) - 20 * size
    at = body + 10 * size
    flight = Px4Log().read(tmp_path / "x", whole[:at] + b"\x00" * 7 + whole[at:])
    assert len(flight["imu"]) == 20
    (fault,) = flight.provenance.findings
    assert fault.kind == "checksum"
    assert f"byte {at} begins no ULog message, 7 bytes left out" in fault.evidence


def test_a_wrong_size_costs_one_message(tmp_path):
    whole = bytearray(ulog({"sensor_combined": REST}))
    size = 3 + 2 + 8 + 24
    whole[len(whole) - 10 * size] ^= 0x14
    flight = Px4Log().read(tmp_path / "x", bytes(whole))
    assert len(flight["imu"]) == 19
    assert f"{size} bytes left out" in flight.provenance.findings[0].evidence


def test_data_appended_behind_a_cut(tmp_path):
    """A crash leaves a cut message; what was appended behind it begins where the flags say."""
    whole = ulog({"sensor_combined": REST})
    size = 3 + 2 + 8 + 24
    at = len(whole) - 10 * size
    flags = bytes(8) + b"\x01" + bytes(7) + (at + 11).to_bytes(8, "little") + bytes(16)
    data = whole[:19] + flags + whole[59:at] + whole[at : at + 11] + whole[at:]
    assert len(Px4Log().read(tmp_path / "x", data)["imu"]) == 20


def test_stamps_beyond_any_flight_are_left_out(tmp_path):
    rows = [*REST[:19], (2**62, *REST[0][1:])]
    flight = Px4Log().read(tmp_path / "x", ulog({"sensor_combined": rows}))
    assert len(flight["imu"]) == 19
    assert "1 messages with impossible times left out" in flight.provenance.findings[0].evidence


def test_broken_logs_end_in_a_flight_or_one_line(tmp_path, capsys):
    whole = ulog({"sensor_combined": REST, "battery_status": [(t, 16.0) for t in T]}, {"CA_ROTOR_COUNT": 4})
    rng = np.random.default_rng(4)
    for trial in range(120):
        data = bytearray(whole)
        for at in rng.integers(7, len(data), 1 + trial % 4):
            data[at] ^= int(rng.integers(1, 256))
        (tmp_path / f"{trial}").write_bytes(data[: None if trial % 3 else int(rng.integers(8, len(data)))])
    loaded = load_recordings([tmp_path], cache=False)
    assert len(loaded.flights) > 60
    for failure in loaded.failed:
        assert failure["path"] in failure["error"]
        assert "\n" not in failure["error"]
        assert "failed," not in failure["error"], "an exception that is no NanobenchError"
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (MAGIC, "cannot be read as ULog"),
        (ulog({}), "the log was stopped before it began"),
        (ulog({"sensor_gps": [(t, 0) for t in T]}), "of what is known here it holds sensor_gps"),
    ],
)
def test_logs_without_a_flight(tmp_path, data, words):
    (tmp_path / "a").write_bytes(data)
    (failure,) = load_recordings([tmp_path], cache=False).failed
    assert words in failure["error"]


def test_missing_extra_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyulog", None)
    (tmp_path / "a").write_bytes(ulog({"sensor_combined": REST}))
    (failure,) = load_recordings([tmp_path], cache=False).failed
    says = f"a PX4 log is read through pyulog; {how_to_install('ulog')}"
    assert failure["error"] == f"{tmp_path / 'a'}: {says}"

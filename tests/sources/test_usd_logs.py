"""uSD logs against logs packed by struct from the description of the firmware."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from source_samples import usd_log

from nanobench_tools import InputError
from nanobench_tools.sources import load_recordings
from nanobench_tools.sources.known import ecosystem
from nanobench_tools.sources.usd import UsdLog, parse_log


@pytest.mark.parametrize("version", [1, 2])
def test_values_units_and_clocks(tmp_path, version):
    sample = usd_log(version)
    (tmp_path / "log00").write_bytes(sample.data)
    flight = load_recordings([tmp_path], cache=False).flights[0]
    fixed = np.array([v for _, v in sample.fixed])
    assert flight.provenance.findings == ()
    assert flight.epoch_s == pytest.approx(5.0)
    np.testing.assert_allclose(flight["imu"].time_s, 0.01 * np.arange(40), atol=1e-12)
    np.testing.assert_allclose(flight["imu"]["gyro_y"], np.radians(fixed[:, 1]))
    np.testing.assert_allclose(flight["imu"]["acc_z"], 9.81)
    np.testing.assert_allclose(flight["attitude"]["pitch"], -np.radians(fixed[:, 8]))
    np.testing.assert_allclose(flight["motor"]["m1", "m2", "m3", "m4"], fixed[:, 3:7] / 65535.0)
    np.testing.assert_allclose(flight["battery"]["vbat"], 3.7 + 0.001 * np.arange(40))
    np.testing.assert_allclose(flight["extra"]["someone.else"], fixed[:, 9])
    np.testing.assert_allclose(flight["extra"]["half.float"], 0.5)
    poses = np.array([p for _, p in sample.poses])
    assert flight["mocap"].samples == len(poses) == 14
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz", "qx", "qy", "qz", "qw"], poses)
    np.testing.assert_allclose(flight["mocap"].time_s, 0.005 + 0.03 * np.arange(14), atol=1e-12)


def test_every_cut_keeps_all_whole_records():
    sample = usd_log(records=8)
    for end in range(sample.body + 1, len(sample.data)):
        log = parse_log(sample.data[:end], "x")
        assert sum(map(len, log.records.values())) == sum(e <= end for e in sample.ends)
        assert log.fault is not None


def test_flipped_bit_in_a_value_is_a_checksum_fault_over_everything(tmp_path):
    sample = usd_log()
    data = bytearray(sample.data)
    data[sample.ends[5] + 14] ^= 0x40
    flight = UsdLog().read(tmp_path / "x", bytes(data))
    (fault,) = flight.provenance.findings
    assert fault.kind == "checksum"
    assert (fault.start_s, fault.end_s) == (0.0, flight.span.end_s)


def test_values_that_are_no_measurement(tmp_path):
    """A NaN and 1e30 in a log whose checksum is right."""
    sample = usd_log()
    data = bytearray(sample.data[:-4])
    data[sample.ends[2] + 10 : sample.ends[2] + 14] = struct.pack("<f", float("nan"))
    data[sample.ends[3] + 10 : sample.ends[3] + 14] = struct.pack("<f", 1e30)
    flight = UsdLog().read(tmp_path / "x", bytes(data) + struct.pack("<I", zlib.crc32(bytes(data))))
    (fault,) = flight.provenance.findings
    assert (fault.kind, fault.stream, fault.columns, fault.size) == ("bad_cell", "estimator", ("stateEstimate.x",), 2.0)
    assert np.isnan(flight["estimator"]["x"]).sum() == 2
    assert np.isfinite(flight["imu"].values).all()


def test_stamps_of_any_size(tmp_path):
    """Time since boot is unsigned and may use all 64 bits."""
    header = struct.pack("<HHH", 2, 1, 3) + b"tick\0" + struct.pack("<H", 1) + b"pm.vbat(f)\0"
    body = b"".join(struct.pack("<HQf", 3, 2**64 - 50 + 10 * i, 3.7) for i in range(5))
    flight = UsdLog().read(tmp_path / "x", _log(header, body))
    np.testing.assert_allclose(flight["battery"].time_s, 1e-5 * np.arange(5), atol=1e-12)


def test_motor_is_what_the_motors_got():
    both = ecosystem("crazyflie").assign(("motor.m1", "pwm.m1_pwm", "motor.m1req"))
    assert both["motor"]["m1"].name == "pwm.m1_pwm"
    assert both["motor_request"]["m1"].name == "motor.m1req"
    old = ecosystem("crazyflie").assign(("motor.m1", "pwm.m1_pwm"))
    assert (old["motor"]["m1"].name, old["motor_request"]["m1"].name) == ("pwm.m1_pwm", "motor.m1")
    new = ecosystem("crazyflie").assign(("motor.m1", "motor.m1req"))
    assert (new["motor"]["m1"].name, new["motor_request"]["m1"].name) == ("motor.m1", "motor.m1req")
    assert "motor_request" not in ecosystem("crazyflie").assign(("motor.m1",))


def test_compressed_state_estimate():
    plan = ecosystem("crazyflie").assign(("stateEstimateZ.az", "stateEstimateZ.ratePitch", "stateEstimateZ.x"))
    az, rate, x = plan["estimator_acc"]["az"], plan["imu"]["gyro_y"], plan["estimator"]["x"]
    assert 9810.0 * az.scale + az.offset == pytest.approx(0.0)
    assert 1000.0 * rate.scale == pytest.approx(-1.0)
    assert 1500.0 * x.scale == pytest.approx(1.5)


LEE = ("stateEstimateZ.z", "ctrltargetZ.z", "ctrlLee.rpyy", "ctrlLee.omegay", "ctrlLee.thrustSi")


def test_a_log_of_the_lee_controller(tmp_path):
    """Millimetres of estimate and set-point, and SI of the controller, as the firmware's log groups say."""
    header = struct.pack("<HHH", 2, 1, 3) + b"lee\0" + struct.pack("<H", 5)
    header += b"".join(f"{name}({kind})".encode() + b"\0" for name, kind in zip(LEE, "hhfff", strict=True))
    body = b"".join(struct.pack("<HQhhfff", 3, 4000 * i, 1324, 1000, 0.25, -0.5, 0.3125) for i in range(5))
    flight = UsdLog().read(tmp_path / "x", _log(header, body))
    assert flight["estimator"]["z"][0] == pytest.approx(1.324)
    assert flight["setpoint"]["z"][0] == pytest.approx(1.0)
    assert flight["attitude"]["pitch"][0] == pytest.approx(0.25)
    assert flight["imu"]["gyro_y"][0] == pytest.approx(-0.5)
    assert (flight["command"]["thrust"][0], flight["command"].unit) == (0.3125, ("N",))
    assert "extra_lee" not in flight


def test_positions_without_an_attitude_are_no_pose_of_four_zeros(tmp_path):
    names = ("x", "y", "z", "qx", "qy", "qz", "qw")
    header = struct.pack("<HHH", 2, 1, 3) + b"pos\0" + struct.pack("<H", 7)
    header += b"".join(f"locSrv.{name}(f)".encode() + b"\0" for name in names)
    body = b"".join(struct.pack("<HQ7f", 3, 10000 * i, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0) for i in range(5))
    assert UsdLog().read(tmp_path / "x", _log(header, body))["mocap"].quantities == ("px", "py", "pz")


def _log(header: bytes, body: bytes = b"") -> bytes:
    data = b"\xbc" + header + body
    return data + struct.pack("<I", zlib.crc32(data))


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (_log(struct.pack("<HH", 7, 0)) + b"fixedFrequency\0", "uSD log version 7"),
        (_log(struct.pack("<HH", 2, 1)), "header of the uSD log ends early|no end"),
        (
            _log(struct.pack("<HHH", 2, 1, 0xFFFF) + b"fixedFrequency\0" + struct.pack("<H", 1) + b"gyro.x(q)\0"),
            "of unknown type",
        ),
        (
            _log(struct.pack("<HHH", 2, 1, 0xFFFF) + b"fixedFrequency\0" + struct.pack("<H", 1) + b"gyro.x(f)\0"),
            "without any record",
        ),
        (
            _log(struct.pack("<HHH", 2, 1, 3) + b"tick\0" + struct.pack("<H", 0), struct.pack("<HQ", 3, 17)),
            "without any variable",
        ),
        (
            _log(struct.pack("<HHH", 2, 2, 3) + b"a\0" + struct.pack("<HH", 0, 3) + b"b\0" + struct.pack("<H", 0)),
            "two event types",
        ),
    ],
)
def test_headers_that_cannot_be_read(tmp_path, data, words):
    with pytest.raises(InputError, match=words):
        UsdLog().read(tmp_path / "x", data)


def test_zeros_after_a_power_cut_are_not_records(tmp_path):
    """A card that lost power may hold zeros behind the last block; event 4 of the sample has number 4, not 0."""
    sample = usd_log()
    flight = UsdLog().read(tmp_path / "x", sample.data[: sample.ends[20]] + bytes(5000))
    assert len(flight["imu"]) + len(flight["mocap"]) == 21
    assert {f.kind for f in flight.provenance.findings} == {"checksum"}


def test_measured_rotor_speeds_of_firmware_2026_08(tmp_path):
    """motor.m1_rpm is rotor speed; 65535 is no measurement, and no fault."""
    names = [f"motor.m{i}_rpm" for i in (1, 2, 3, 4)]
    header = struct.pack("<HHH", 2, 1, 3) + b"rotors\0" + struct.pack("<H", 4)
    header += b"".join(f"{name}(H)".encode() + b"\0" for name in names)
    body = b"".join(struct.pack("<HQ4H", 3, 10000 * i, 18000, 18300, 65535 if i == 2 else 18600, 0) for i in range(5))
    flight = UsdLog().read(tmp_path / "x", _log(header, body))
    assert flight["rpm"]["m1"][0] == pytest.approx(18000 * 2 * np.pi / 60)
    assert np.isnan(flight["rpm"]["m3"]).tolist() == [False, False, True, False, False]
    assert flight.provenance.findings == ()


def _half_log(values):
    header = struct.pack("<HHH", 2, 1, 3) + b"half\0" + struct.pack("<H", 2)
    header += b"stateEstimate.x(e)\0stateEstimate.y(f)\0"
    body = b"".join(struct.pack("<HQef", 3, 10000 * i, v, v) for i, v in enumerate(values))
    return _log(header, body)


def test_halved_values_of_half_precision_are_doubled(tmp_path):
    """The firmware lost a carry: 1.9999 became 1.0. The same numbers in single precision are left alone."""
    values = [1.90, 1.95, 1.0, 2.02, 2.05, -0.51, -0.25, -0.25, -0.49, 1.1, 1.0, 0.9]
    flight = UsdLog().read(tmp_path / "x", _half_log(values))
    mended = [1.90, 1.95, 2.0, 2.02, 2.05, -0.51, -0.5, -0.5, -0.49, 1.1, 1.0, 0.9]
    np.testing.assert_allclose(flight["estimator"]["x"], mended, rtol=1e-3)
    np.testing.assert_allclose(flight["estimator"]["y"], values, rtol=1e-6)
    (fault,) = flight.provenance.findings
    assert (fault.kind, fault.columns, fault.size) == ("half_precision", ("stateEstimate.x",), 3.0)


def test_every_halved_value_is_found_in_a_sweep(tmp_path):
    """A rounding to half precision without its carry, written from the format: exponent bits are or-ed, not added."""
    def broken(value):
        half = np.float16(value)
        fraction, exponent = np.frexp(value)
        exact = fraction * 2.0 ** 11  # the eleven bits that half precision keeps
        carried = round(exact) == 2 ** 11 and exact < 2 ** 11
        return half / 2 if carried and (exponent - 1) % 2 == 0 else half

    values = np.linspace(0.05, 9.0, 40001)
    logged = np.array([broken(v) for v in values], float)
    assert (np.abs(logged / values - 0.5) < 1e-3).sum() >= 4
    flight = UsdLog().read(tmp_path / "x", _half_log(logged))
    np.testing.assert_allclose(flight["estimator"]["x"], values, rtol=1e-3)

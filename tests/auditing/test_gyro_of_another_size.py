"""A recording of an IMU alone: the specific force shows that the gyro is in another unit."""

from __future__ import annotations

import numpy as np
import pytest
from fifteen import EIGHT, STOPPED
from scipy.spatial.transform import Rotation

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.signals.tumbling import gyro_scale
from nanobench_tools.sources import load_recordings

DEG = 180.0 / np.pi
STEP_S = 0.01
IMU = ("gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y", "acc_z")


def flown():
    """(n,) s, gyro (n, 3) rad/s and specific force (n, 3) m/s^2 of 20 s in the air: its thrust is along z."""
    t = np.arange(0.0, 20.0, STEP_S)
    rng = np.random.default_rng(3)
    a = np.stack([2.0 * np.sin(1.5 * t), 1.5 * np.cos(2.1 * t), np.sin(0.9 * t)], axis=1)
    force = a + np.array([0.0, 0.0, 9.81])
    up = force / np.linalg.norm(force, axis=1, keepdims=True)
    left = np.cross(up, [1.0, 0.0, 0.0])
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    turn = Rotation.from_matrix(np.stack([np.cross(left, up), left, up], axis=2))
    gyro = np.zeros_like(a)
    gyro[:-1] = (turn[:-1].inv() * turn[1:]).as_rotvec() / STEP_S
    return t, gyro + 0.02 * rng.standard_normal(a.shape), turn.inv().apply(force) + 0.2 * rng.standard_normal(a.shape)


def faults(factor):
    t, gyro, force = flown()
    imu = make_stream("imu", t, np.hstack([factor * gyro, force]), IMU)
    return [f for f in audit(Flight("imu", {"imu": imu}, {}, Provenance("made", "", "test"))).faults
            if f.kind == "unit"]


@pytest.mark.parametrize("factor", [DEG, 1.0 / DEG, 16.4 * DEG])
def test_the_audit_finds_the_unit(factor):
    fault, = faults(factor)
    assert fault.columns == IMU[:3]
    assert fault.size == pytest.approx(factor, rel=1e-3)


def test_a_gyro_in_its_unit_is_no_fault():
    assert faults(1.0) == []


def test_a_smaller_scale_is_open_without_an_attitude():
    t, gyro, force = flown()
    imu = make_stream("imu", t, np.hstack([gyro, force]), IMU)
    found = audit(Flight("imu", {"imu": imu}, {}, Provenance("made", "", "test"))).unchecked
    assert any(e.startswith("sign, axis and scale of gyro_x, gyro_y, gyro_z") for e in found)
    assert "scale of t (imu)" in found


@pytest.mark.real
def test_no_real_gyro_is_in_another_unit(real_data):
    """Some of these end in a crash."""
    folder = real_data / "nanobench" / "datasets" / "dataset"
    for flight in load_recordings([folder / f"{name}.csv.xz" for name in EIGHT]).flights:
        imu = flight["imu"]
        gyro, force = imu[IMU[:3]], imu[IMU[3:]]
        assert gyro_scale(imu.time_s, gyro, force) is None, flight.name
        found = gyro_scale(imu.time_s, DEG * gyro, force)
        assert found is None or flight.name in STOPPED or found.factor == pytest.approx(DEG), flight.name


@pytest.mark.parametrize("factor", [1.0, 1.0 / DEG])
def test_a_vehicle_at_rest_shows_nothing(factor):
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 20.0, STEP_S)
    force = np.array([0.0, 0.0, 9.81]) + 0.02 * rng.standard_normal((len(t), 3))
    assert gyro_scale(t, factor * 0.02 * rng.standard_normal((len(t), 3)), force) is None


def test_a_crash_at_the_end_is_no_unit():
    t, gyro, force = flown()
    gyro[t > 13.0] *= DEG
    assert gyro_scale(t, gyro, force) is None


@pytest.mark.parametrize(("header", "factor", "unit"), [
    (" [rad/s]", 1.0, "rad/s"), (" [deg/s]", DEG, "deg/s"), ("", DEG, "deg/s"), (" [rad/s]", DEG, ""),
    (" [deg/s]", 1.0, "")])
def test_a_draft_does_not_believe_a_header_that_the_flight_contradicts(tmp_path, header, factor, unit):
    t, gyro, force = flown()
    names = ["t", *(f"gyro_{a}{header}" for a in "xyz"), *(f"acc_{a} [m/s^2]" for a in "xyz")]
    path = tmp_path / "imu.csv"
    np.savetxt(path, np.column_stack([t, factor * gyro, force]), delimiter=",", header=",".join(names), comments="",
               fmt="%.8g")
    draft = draft_columns(path)
    assert draft.mapped.get(("imu", "gyro_x")) == ((f"gyro_x{header}", unit) if unit else None)
    assert bool(draft.questions) != bool(unit)

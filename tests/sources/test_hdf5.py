"""DIDO and Blackbird as HDF5, written to the facts of the formats from a flight that is known."""

from __future__ import annotations

import io
import sys

import h5py
import numpy as np
import pytest
from test_draft_axes import G, flown

from nanobench_tools.errors import how_to_install
from nanobench_tools.sources import load_recordings

EPOCH_S = 1.6e9
RPM = 14648.0
DOWN = np.array([1.0, -1.0, -1.0])


def file(**tables):
    content = io.BytesIO()
    with h5py.File(content, "w") as made:
        for name, values in tables.items():
            made.create_dataset(name, data=np.asarray(values, dtype=float))
    return content.getvalue()


def dido(**changed):
    t, p, v, a, turn, w = flown()
    stamps = EPOCH_S + t
    rpm = np.column_stack([100.0 * stamps, np.tile(1e-4 * RPM * np.array([1.0, 1.01, 0.99, 1.02]), (len(t), 1))])
    return {"ts": stamps, "acc": turn.inv().apply(a + G), "gyr": w, "gt_acc": a, "gt_alpha": w, "gt_gyr": w, "gt_p": p,
            "gt_v": v, "gt_q": np.roll(turn.as_quat(), 1, axis=1), "meas_rpm": rpm,
            "dynamic_params": np.arange(9.0)} | changed


def blackbird(**changed):
    t, p, _, a, turn, w = flown()
    force = turn.inv().apply(a + G)
    frd = turn * type(turn).from_euler("x", 180.0, degrees=True)
    thrust = np.column_stack([0.0 * t, 0.0 * t, np.full(len(t), -9.8)])
    return {"ts": EPOCH_S + t, "gyro_raw": w * DOWN, "gyro_calib": w * DOWN,
            "accel_raw": force * DOWN, "traj_target": np.hstack([p, frd.as_quat()]), "thrust": thrust,
            "i_thrust": thrust, "gyro_bias": np.zeros(3)} | changed


def read(tmp_path, tables):
    (tmp_path / "data.hdf5").write_bytes(file(**tables))
    return load_recordings([tmp_path], cache=False)


def check(flight):
    t, p, _, a, turn, w = flown()
    np.testing.assert_allclose(flight["imu"].time_s, t, atol=1e-6)
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w)
    np.testing.assert_allclose(flight["imu"]["acc_x", "acc_y", "acc_z"], turn.inv().apply(a + G))
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p)
    q = type(turn).from_quat(flight["mocap"]["qx", "qy", "qz", "qw"])
    assert (q.inv() * turn).magnitude().max() < 1e-9
    assert flight.epoch_s == pytest.approx(EPOCH_S)


def test_dido(tmp_path):
    (flight,) = read(tmp_path, dido()).flights
    check(flight)
    assert set(flight.streams) == {"mocap", "imu", "rpm"}
    np.testing.assert_allclose(flight["rpm"].values[0, 0], RPM * 2.0 * np.pi / 60.0)


def test_rotor_speeds_in_another_unit_are_left_out(tmp_path):
    rpm = dido()["meas_rpm"].copy()
    rpm[:, 1:] *= 1e4
    (flight,) = read(tmp_path, dido(meas_rpm=rpm)).flights
    assert "rpm" not in flight
    assert any("rpm left out" in note for note in flight.provenance.notes)


def test_blackbird_has_its_body_turned(tmp_path):
    (flight,) = read(tmp_path, blackbird()).flights
    check(flight)
    assert set(flight.streams) == {"mocap", "imu", "extra_specific_thrust"}
    assert any("FRD turned" in note for note in flight.provenance.notes)


@pytest.mark.parametrize(("tables", "words"), [
    (dido(gt_p=np.zeros((5, 3))), "has the shape (5, 3)"), (dido(gt_q=3.0 * dido()["gt_q"]), "no unit length"),
    (dido(ts=1e9 * dido()["ts"]), "no column of seconds"),
    (dido(ts=np.full(len(flown()[0]), np.nan)), "no column of seconds"),
    (blackbird(gyro_raw=np.zeros((4, 2))), "has the shape (4, 2)"),
    (blackbird(accel_raw=blackbird()["accel_raw"] * DOWN), "where gravity belongs"),
    (blackbird(accel_raw=blackbird()["accel_raw"] / 9.81), "where gravity belongs")])
def test_what_cannot_be_right_is_refused(tmp_path, tables, words):
    (failure,) = read(tmp_path, tables).failed
    assert words in failure["error"]


def test_rows_without_numbers_are_findings(tmp_path):
    tables = dido()
    tables["acc"][5] = np.nan
    tables["ts"][9] = 0.0
    (flight,) = read(tmp_path, tables).flights
    assert len(flight["imu"]) == len(tables["ts"]) - 1
    assert {f.kind for f in flight.provenance.findings} == {"bad_cell"}


def test_other_groups_and_links_are_refused(tmp_path):
    content = io.BytesIO()
    with h5py.File(content, "w") as made:
        made.create_group("ts")
        made["gt_q"] = h5py.ExternalLink("/etc/passwd", "x")
        made.create_dataset("meas_rpm", data=np.zeros((3, 5)))
    (tmp_path / "a.h5").write_bytes(content.getvalue())
    loaded = load_recordings([tmp_path], cache=False)
    assert (loaded.flights, len(loaded.failed)) == ([], 1)


def test_missing_extra_is_one_line(tmp_path, monkeypatch):
    (tmp_path / "data.hdf5").write_bytes(file(**dido()))
    monkeypatch.setitem(sys.modules, "h5py", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    (failure,) = load_recordings([tmp_path], cache=False).failed
    assert f"an HDF5 file is read through h5py: {how_to_install('hdf5')}" in failure["error"]

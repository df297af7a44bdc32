"""Data sets in the ASL layout: folder, archive and single tables give the flight that was written."""

from __future__ import annotations

import gzip

import numpy as np
import pytest
from asl_samples import ACC_BIAS, CAMERA, EPOCH_NS, EUROC_BODY, GYRO_BIAS, HEADERS, archive, members, write_folder
from scipy.spatial.transform import Rotation
from test_draft_axes import G, flown

from nanobench_tools.cli.estimate import nothing_logged
from nanobench_tools.sources import load_recordings, payload
from nanobench_tools.sources import members as archives
from nanobench_tools.sources.asl_sensor import columns_of
from nanobench_tools.sources.payload import read_file

POSITION, ROTATION, VELOCITY = ("px", "py", "pz"), ("qx", "qy", "qz", "qw"), ("vx", "vy", "vz")
GYRO, ACC = ("gyro_x", "gyro_y", "gyro_z"), ("acc_x", "acc_y", "acc_z")
LATE = 100
"""Rows before the truth begins."""


def one(place):
    loaded = load_recordings([place], cache=False)
    assert loaded.failed == []
    (flight,) = loaded.flights
    return flight


def refusal(place):
    loaded = load_recordings([place], cache=False)
    assert loaded.flights == []
    (failure,) = loaded.failed
    assert "\n" not in failure["error"]
    return failure["error"]


def check(flight, velocity=True, position_m=2e-6):
    """The flight is the one flown, in forward, left, up."""
    t, p, v, a, turn, w = flown()
    mocap, imu = flight["mocap"], flight["imu"]
    np.testing.assert_allclose(mocap.time_s, t[LATE:], atol=1e-9)
    np.testing.assert_allclose(imu.time_s, t, atol=1e-9)
    np.testing.assert_allclose(mocap[POSITION], p[LATE:], atol=position_m)
    if velocity:
        np.testing.assert_allclose(mocap[VELOCITY], v[LATE:], atol=1e-6)
    assert (Rotation.from_quat(mocap[ROTATION]).inv() * turn[LATE:]).magnitude().max() < 3e-6
    np.testing.assert_allclose(imu[GYRO], w + EUROC_BODY @ GYRO_BIAS, atol=1e-6)
    np.testing.assert_allclose(imu[ACC], turn.inv().apply(a + G) + EUROC_BODY @ ACC_BIAS, atol=1e-6)


def test_a_folder_and_its_archive_are_the_same_flight(tmp_path):
    files = {**members(), **CAMERA}
    folder = one(write_folder(tmp_path, files))
    check(folder)
    assert (folder.name, folder.provenance.source, folder.epoch_s) == ("V1_09_made", "euroc", EPOCH_NS * 1e-9)
    bias = folder["extra_imu_bias"]
    np.testing.assert_allclose(bias.values[0], [*EUROC_BODY @ GYRO_BIAS, *EUROC_BODY @ ACC_BIAS], atol=1e-6)
    assert set(folder.streams) == {"mocap", "imu", "extra_imu_bias"}
    assert any("URF turned into forward, left, up" in n and "camera looks" in n for n in folder.provenance.notes)
    (tmp_path / "packed").mkdir()
    (tmp_path / "packed" / "V1_09_made.zip").write_bytes(archive(files))
    packed = one(tmp_path / "packed")
    check(packed)
    assert packed.name == "V1_09_made"


def test_packed_tables_of_a_folder_are_one_flight(tmp_path):
    folder = write_folder(tmp_path, {**members(), **CAMERA})
    for table in (folder / "mav0").glob("*/data.csv"):
        if not table.parent.name.startswith("cam"):
            table.with_name("data.csv.gz").write_bytes(gzip.compress(table.read_bytes()))
            table.unlink()
    check(one(folder))


def test_two_sequences_are_two_flights_and_one_table_is_one(tmp_path):
    a, b = (write_folder(tmp_path, members(), name) for name in ("V1_01", "V1_02"))
    assert {f.name for f in load_recordings([tmp_path], cache=False).flights} == {"V1_01", "V1_02"}
    imu = one(a / "mav0" / "imu0" / "data.csv")
    assert set(imu.streams) == {"imu"}
    assert any("z is taken as forward, as in EuRoC" in n for n in imu.provenance.notes)
    truth = tmp_path / "V102_groundtruth.csv"
    truth.write_bytes((b / "mav0" / "state_groundtruth_estimate0" / "data.csv").read_bytes())
    assert set(one(truth).streams) == {"mocap", "extra_imu_bias"}


def test_the_pose_of_markers_becomes_that_of_the_body(tmp_path):
    check(one(write_folder(tmp_path, {**members("vicon0"), **CAMERA})), velocity=False)


def test_a_pose_and_an_imu_of_different_axes_are_left_alone_and_told(tmp_path):
    """The sheet that turns the IMU into the body is lost."""
    turn = Rotation.from_euler("y", 90.0, degrees=True).as_matrix()
    files = {**members(imu_in_body=turn), **CAMERA}
    del files["imu0/sensor.yaml"]
    flight = one(write_folder(tmp_path, files))
    assert any("body axis is up, so one sensor.yaml is missing" in n
               for n in flight.provenance.notes)
    assert "imu0: no T_BS in a sensor.yaml, so its axes and origin are taken as those of the body" in (
        flight.metadata["read_as"])


def test_a_turned_imu_is_turned_back(tmp_path):
    turn = Rotation.from_euler("ZYX", (30.0, -40.0, 15.0), degrees=True).as_matrix()
    flight = one(write_folder(tmp_path, {**members(imu_in_body=turn), **CAMERA}))
    *_, w = flown()
    expected = w + EUROC_BODY @ turn @ GYRO_BIAS
    np.testing.assert_allclose(flight["imu"][GYRO], expected, atol=1e-6)


def test_positions_alone_stay_those_of_the_prism(tmp_path):
    flight = one(write_folder(tmp_path, members("leica0")))
    assert flight["mocap"].quantities == POSITION
    assert any("positions are those of the prism, 122 mm" in n for n in flight.provenance.notes)


def test_tum_vi_has_a_body_with_z_up_and_its_poses_in_mocap0(tmp_path):
    files = members("vicon0", body=np.eye(3))
    t, p, *_, turn, _ = flown()
    rows = np.hstack([p, np.roll(turn.as_quat(), 1, axis=1)])[LATE:]
    stamps = EPOCH_NS + np.round(t * 1e9).astype(np.int64)[LATE:]
    text = "\n".join([HEADERS["vicon0"], *(",".join([str(s), *(f"{v:.9f}" for v in r)])
                                           for s, r in zip(stamps, rows, strict=True))]) + "\n"
    kept = {k: v for k, v in files.items() if k.startswith("imu0")} | {"mocap0/data.csv": text.encode()}
    flight = one(write_folder(tmp_path, kept))
    np.testing.assert_allclose(flight["mocap"][ROTATION], turn[LATE:].as_quat(), atol=1e-8)
    np.testing.assert_allclose(flight["mocap"][POSITION], p[LATE:], atol=1e-8)
    assert any("mocap0: no T_BS in a sensor.yaml" in n for n in flight.provenance.notes)
    assert not any("turned into forward" in n for n in flight.provenance.notes)


def test_further_truth_is_kept_apart(tmp_path):
    flight = one(write_folder(tmp_path, {**members(), **members("vicon0"), **members("leica0")}))
    assert set(flight.streams) == {"mocap", "imu", "extra_imu_bias", "extra_vicon0", "extra_leica0"}
    check(flight)


@pytest.mark.parametrize(("change", "words"), [
    (lambda f: f | {"imu0/sensor.yaml": f["imu0/sensor.yaml"].replace(b"cols", b"cols: 3\n  cols")}, None),
    (lambda f: f | {"imu0/sensor.yaml": b"sensor_type: imu\nT_BS:\n  data: [1, 2, 3]\n"}, "no matrix of 4 rows"),
    (lambda f: f | {"imu0/sensor.yaml": b"sensor_type: imu\nT_BS: [[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]\n"},
     "no rigid motion"),
    (lambda f: f | {"imu0/data.csv": f["imu0/data.csv"].replace(b"[ns]", b"[us]")}, "holds no time"),
    (lambda f: f | {"imu0/data.csv": f["imu0/data.csv"].replace(b"m s^-2", b"furlong")}, "not a unit of the acc"),
], ids=["a key twice", "short matrix", "stretched", "another unit of time", "an unknown unit"])
def test_what_cannot_be_right_is_refused(tmp_path, change, words):
    root = write_folder(tmp_path, change(members()))
    if words is None:
        check(one(root))
    else:
        assert words in refusal(root)


@pytest.mark.parametrize("scale", [1000, 1000000, 1000000000])
def test_timestamps_without_a_unit_are_nanoseconds_or_refused(tmp_path, scale):
    lines = members()["state_groundtruth_estimate0/data.csv"].decode().split("\n")
    cells = [line.split(",", 1) for line in lines[1:] if line]
    text = "\n".join([lines[0], *(f"{int(a) / scale:.9f},{b}" for a, b in cells)]) + "\n"
    (tmp_path / "truth.csv").write_text(text)
    assert "not in the unit that the format or the header gives" in refusal(tmp_path / "truth.csv")


def test_damaged_rows_are_findings(tmp_path):
    files = members()
    lines = files["state_groundtruth_estimate0/data.csv"].decode().split("\n")
    cells = [line.split(",") for line in lines]
    cells[5][4:8] = ["0.3"] * 4  # no unit quaternion
    cells[9][2] = "nan"
    cells[12][0] = "17"  # no time of this recording
    files["state_groundtruth_estimate0/data.csv"] = "\n".join(map(",".join, cells)).encode()
    flight = one(write_folder(tmp_path, files))
    told = " ".join(f.evidence for f in flight.provenance.findings)
    assert "1 quaternions without unit length" in told
    assert "row left out, line 13" in told
    assert np.isnan(flight["mocap"]["qw"][4])
    assert np.isnan(flight["mocap"]["py"][8])
    assert len(flight["mocap"]) == len(lines) - 3


def test_a_sensor_whose_names_are_damaged_is_listed(tmp_path):
    files = {**members(), **CAMERA}
    files["imu0/data.csv"] = files["imu0/data.csv"].split(b"\n", 1)[1]
    loaded = load_recordings([write_folder(tmp_path, files)], cache=False)
    assert [set(f.streams) for f in loaded.flights] == [{"mocap", "extra_imu_bias"}]
    assert ["imu0/data.csv" in f["error"] for f in loaded.failed] == [True]


def test_open_vins_tables_are_the_same_columns():
    line = "#time(ns),px,py,pz,qw,qx,qy,qz,vx,vy,vz,bwx,bwy,bwz,bax,bay,baz"
    found = columns_of(line)
    assert [name for name, _ in found.vectors["quaternion"]] == ["qx", "qy", "qz", "qw"]
    assert columns_of("#timestamp [ns],filename") is None
    assert columns_of("time,px,py,pz,qw,qx,qy,qz") is None


def test_of_an_archive_with_pictures_only_the_tables_are_read(tmp_path, monkeypatch):
    """Archives of EuRoC have gigabytes of pictures."""
    pictures = {f"cam0/data/{k}.png": np.random.default_rng(k).bytes(100_000) for k in range(20)}
    (tmp_path / "V1_09_made.zip").write_bytes(archive({**members(), **pictures}))
    whole = []

    def read(path, limit=None):
        whole.extend([path] if limit is None else [])
        return read_file(path, limit)

    for module in (payload, archives):
        monkeypatch.setattr(module, "read_file", read)
    check(one(tmp_path / "V1_09_made.zip"))
    assert whole == []


def test_archives_that_unpack_to_far_more_than_a_recording_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(payload, "SMALL_BYTES", 1 << 20)
    bomb = members()
    bomb["imu0/data.csv"] += b"0" * (1 << 23)
    (tmp_path / "a.zip").write_bytes(archive(bomb))
    assert "the archive unpacks to" in refusal(tmp_path / "a.zip")
    (tmp_path / "b.csv.gz").write_bytes(gzip.compress(members()["imu0/data.csv"] + b"0" * (1 << 29 >> 5)))
    assert "the archive unpacks to" in refusal(tmp_path / "b.csv.gz")


def test_archives_without_a_data_set_are_refused_with_the_reason(tmp_path):
    (tmp_path / "a.zip").write_bytes(archive({"notes/readme.txt": b"none", "notes/more.txt": b"none"}))
    assert "a zip archive without a data set in the ASL layout" in refusal(tmp_path / "a.zip")
    whole = archive(members())
    (tmp_path / "a.zip").write_bytes(whole[: len(whole) // 2])
    refusal(tmp_path / "a.zip")
    damaged = bytearray(whole)
    damaged[400:420] = bytes(20)
    (tmp_path / "a.zip").write_bytes(bytes(damaged))
    assert "the archive is damaged" in refusal(tmp_path / "a.zip")


def test_estimators_are_scored_where_no_estimate_was_logged(tmp_path):
    flight = one(write_folder(tmp_path, members()))
    assert nothing_logged([flight])
    assert not nothing_logged([flight.without_streams("imu")])


@pytest.mark.parametrize("truth", ["state_groundtruth_estimate0", "vicon0", "leica0"])
def test_a_sensor_and_its_truth_side_by_side_are_one_recording(tmp_path, truth):
    files = members(truth)
    whole = one(write_folder(tmp_path / "whole", {n: d for n, d in files.items() if n.endswith("data.csv")}))
    (tmp_path / "flat").mkdir()
    for name, path in (("imu0", "imu.csv"), (truth, "groundtruth.csv")):
        (tmp_path / "flat" / path).write_bytes(files[f"{name}/data.csv"])
    flight = one(tmp_path / "flat")
    assert flight.name == "flat"
    for name in ("imu", "mocap"):
        np.testing.assert_array_equal(flight[name].values, whole[name].values)
        np.testing.assert_array_equal(flight[name].time_s, whole[name].time_s)


@pytest.mark.parametrize("further", [0, 1])
def test_a_sensor_and_a_trajectory_side_by_side_are_one_recording(tmp_path, further):
    """Not where a second trajectory is there: which one is the truth?"""
    t, p, _, _, turn, _ = flown()
    files = members("vicon0")
    (tmp_path / "imu.csv").write_bytes(files["imu0/data.csv"])
    stamps = [(EPOCH_NS + round(s * 1e9)) for s in t]
    rows = [" ".join([f"{ns // 10**9}.{ns % 10**9:09d}", *(f"{c:.9f}" for c in row)])
            for ns, row in zip(stamps, np.hstack([p, turn.as_quat()]), strict=True)]
    for k in range(1 + further):
        (tmp_path / f"truth{k}.tum").write_text("\n".join(["# timestamp tx ty tz qx qy qz qw", *rows]))
    flights = load_recordings([tmp_path], cache=False).flights
    assert len(flights) == (3 if further else 1)
    if not further:
        mocap = flights[0]["mocap"]
        np.testing.assert_allclose(flights[0].epoch_s + mocap.time_s, [ns * 1e-9 for ns in stamps], atol=1e-6)
        np.testing.assert_allclose(mocap["px", "py", "pz"], p, atol=1e-8)
        assert "gyro_x" in flights[0]["imu"]


def test_a_sensor_and_the_truth_of_another_day_stay_two_recordings(tmp_path):
    files = members()
    later = files["imu0/data.csv"].replace(b"\n14", b"\n15")
    (tmp_path / "imu.csv").write_bytes(later)
    (tmp_path / "groundtruth.csv").write_bytes(files["state_groundtruth_estimate0/data.csv"])
    assert len(load_recordings([tmp_path], cache=False).flights) == 2

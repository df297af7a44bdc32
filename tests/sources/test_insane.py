"""INSANE: the tables of a folder are one flight, as its authors' export writes them."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest
from test_draft_axes import G, flown
from text_mutations import SEEDS, mutations, read_as_before

from nanobench_tools.sources import load_recordings

EPOCH_S = 1.6e9
IMU = ("a_x", "a_y", "a_z", "w_x", "w_y", "w_z")
POSE = ("p_x", "p_y", "p_z", "q_w", "q_x", "q_y", "q_z")


def csv(names, t, values):
    rows = [", ".join(["t", *names]), *(",".join(f"{v:.17g}" for v in row) for row in np.column_stack([t, values]))]
    return ("\n".join(rows) + "\n").encode()


def tables(truth="mocap_vehicle_data.csv", acc=1.0, gyro=1.0):
    t, p, _, a, turn, w = flown()
    imu = np.hstack([acc * turn.inv().apply(a + G), gyro * w])
    pose = np.hstack([p, np.roll(turn.as_quat(), 1, axis=1)])
    rtk = np.column_stack([EPOCH_S + t, 46.0 + 0.0 * t, 14.0 + 0.0 * t, 480.0 + 0.0 * t, p, 3.0 + 0.0 * t])
    return {"px4_imu.csv": csv(IMU, EPOCH_S + t, imu), truth: csv(POSE, EPOCH_S + 0.5 + t, pose),
            "rs_imu.csv": csv(IMU, EPOCH_S + 0.25 + t, imu[:, [1, 2, 0, 4, 5, 3]]),
            "px4_baro.csv": csv(("p",), EPOCH_S + t, 96000.0 + 0.0 * t[:, None]),
            "rtk_gps1.csv": csv(("t_gps", "lat", "long", "alt", "p_x", "p_y", "p_z", "rtk_status"), EPOCH_S + t, rtk),
            "time_info.yaml": b"# Time Info\nt_total: 16.000 # in seconds\nt_begin: 1600000000.0\n"}


def write(folder, files):
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    return folder


def check(flight, mocap_note):
    t, p, _, a, turn, w = flown()
    assert (flight.name, flight.provenance.source) == ("indoor_1_sensors", "insane")
    assert set(flight.streams) == {"imu", "mocap", "extra_rs_imu", "extra_px4_baro", "extra_rtk_gps1"}
    assert flight.epoch_s == pytest.approx(EPOCH_S)
    np.testing.assert_allclose(flight["imu"].time_s, t, atol=1e-6)
    np.testing.assert_allclose(flight["mocap"].time_s, t + 0.5, atol=1e-6)
    np.testing.assert_allclose(flight["extra_rs_imu"].time_s, t + 0.25, atol=1e-6)
    np.testing.assert_allclose(flight["imu"]["acc_x", "acc_y", "acc_z"], turn.inv().apply(a + G))
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w)
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p)
    np.testing.assert_allclose(flight["mocap"]["qx", "qy", "qz", "qw"], turn.as_quat())
    np.testing.assert_allclose(flight["extra_rtk_gps1"]["p_x", "p_y", "p_z"], p)
    assert flight["extra_px4_baro"].unit == ("Pa",)
    assert flight["extra_rtk_gps1"].unit[:4] == ("1", "deg", "deg", "m")
    assert mocap_note in flight.provenance.notes


def test_a_folder_and_its_archive_are_the_same_flight(tmp_path):
    folder = write(tmp_path / "indoor_1_sensors", tables())
    loaded = load_recordings([folder], cache=False)
    assert loaded.failed == []
    check(loaded.flights[0], "mocap is mocap_vehicle_data")
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in tables().items():
            archive.writestr(f"indoor_1_sensors/{name}", data)
    (tmp_path / "indoor_1_sensors.zip").write_bytes(content.getvalue())
    check(load_recordings([tmp_path / "indoor_1_sensors.zip"], cache=False).flights[0], "mocap is mocap_vehicle_data")
    (tmp_path / "indoor_1_sensors.zip").write_bytes(content.getvalue()[:-2000])
    assert load_recordings([tmp_path / "indoor_1_sensors.zip"], cache=False).flights == []


def test_outdoors_the_truth_is_from_rtk(tmp_path):
    files = tables("ground_truth/ground_truth_8hz.csv")
    files["ground_truth/ground_truth_80hz.csv"] = files["ground_truth/ground_truth_8hz.csv"]
    loaded = load_recordings([write(tmp_path / "indoor_1_sensors", files)], cache=False)
    assert loaded.failed == []
    check(loaded.flights[0], "mocap is ground_truth_8hz: two RTK receivers and a magnetometer, no motion capture")


def test_an_imu_alone(tmp_path):
    write(tmp_path / "a", {"rs_imu.csv": tables()["rs_imu.csv"]})
    (flight,) = load_recordings([tmp_path / "a"], cache=False).flights
    assert set(flight.streams) == {"imu"}
    assert "imu is rs_imu, in the axes of that sensor" in flight.provenance.notes


@pytest.mark.parametrize(("wrong", "words"), [({"acc": 1.0 / 9.81}, "where gravity in m/s^2 belongs"),
                                              ({"gyro": 57.3 * 20.0}, "too fast for rad/s")])
def test_other_units_are_refused(tmp_path, wrong, words):
    (failure,) = load_recordings([write(tmp_path / "a", {"px4_imu.csv": tables(**wrong)["px4_imu.csv"]})],
                                 cache=False).failed
    assert words in failure["error"]


@pytest.mark.parametrize("seeds", SEEDS)
@pytest.mark.parametrize("name", ["px4_imu.csv", "mocap_vehicle_data.csv"])
def test_damage_gives_no_other_number(tmp_path, name, seeds):
    files = {"px4_imu.csv": tables()["px4_imu.csv"], "mocap_vehicle_data.csv": tables()["mocap_vehicle_data.csv"]}
    folder = write(tmp_path / "a", files)
    (before,) = load_recordings([folder], cache=False).flights
    found = [read_as_before(folder, damaged, before, name, whole=True)
             for damaged in mutations(files[name], seeds)]
    assert len(found) == 9 * seeds
    assert sum(flight is not None for flight in found) >= 5 * seeds

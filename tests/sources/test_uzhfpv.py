"""UZH-FPV text: the IMU and the truth of one folder are one flight."""

from __future__ import annotations

import numpy as np
import pytest
from test_draft_axes import G, flown

from nanobench_tools.sources import load_recordings

EPOCH_S = 1540821844.3
NAMES = "timestamp ang_vel_x ang_vel_y ang_vel_z lin_acc_x lin_acc_y lin_acc_z"


def write(folder, numbered=False, named=True, acc=1.0, gyro=1.0, time=1.0, truth=True):
    t, p, _, a, turn, w = flown()
    folder.mkdir(exist_ok=True)
    before = ["id "] if numbered and named else [""]
    rows = [f"# {before[0]}{NAMES}"]
    for k, row in enumerate(np.hstack([gyro * w, acc * turn.inv().apply(a + G)])):
        start = [str(k)] if numbered else []
        rows.append(" ".join([*start, f"{time * (EPOCH_S + t[k]):.6f}", *(f"{v:.8g}" for v in row)]))
    (folder / "imu.txt").write_text("\n".join(rows) + "\n")
    if truth:
        rows = [f"# {before[0]}timestamp tx ty tz qx qy qz qw"]
        for k, row in enumerate(np.hstack([p, turn.as_quat()])):
            start = [str(k)] if numbered else []
            rows.append(" ".join([*start, f"{EPOCH_S + 0.5 + t[k]:.6f}", *(f"{v:.9f}" for v in row)]))
        (folder / "groundtruth.txt").write_text("\n".join(rows) + "\n")
    return folder


@pytest.mark.parametrize(("numbered", "named"), [(False, True), (True, True), (True, False)])
def test_imu_and_truth_are_one_flight(tmp_path, numbered, named):
    loaded = load_recordings([write(tmp_path / "indoor_forward_9", numbered, named)], cache=False)
    assert loaded.failed == []
    (flight,) = loaded.flights
    t, p, _, a, turn, w = flown()
    assert (flight.name, flight.provenance.source) == ("indoor_forward_9", "uzhfpv")
    assert flight.epoch_s == pytest.approx(EPOCH_S)
    np.testing.assert_allclose(flight["imu"].time_s, t, atol=2e-6)
    np.testing.assert_allclose(flight["mocap"].time_s, t + 0.5, atol=2e-6)
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=1e-6)
    np.testing.assert_allclose(flight["imu"]["acc_x", "acc_y", "acc_z"], turn.inv().apply(a + G), atol=1e-6)
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p, atol=1e-8)


def test_an_imu_alone_and_a_truth_alone(tmp_path):
    folder = write(tmp_path / "a", truth=False)
    assert [set(f.streams) for f in load_recordings([folder], cache=False).flights] == [{"imu"}]
    write(tmp_path / "b")
    (tmp_path / "b" / "imu.txt").unlink()
    assert [f.provenance.source for f in load_recordings([tmp_path / "b"], cache=False).flights] == ["tum"]


@pytest.mark.parametrize(("wrong", "words"), [
    ({"acc": 1.0 / 9.81}, "where gravity in m/s^2 belongs"), ({"gyro": 57.3 * 20.0}, "too fast for rad/s"),
    ({"time": 1e9}, "no seconds")])
def test_other_units_are_refused(tmp_path, wrong, words):
    (failure,) = load_recordings([write(tmp_path / "a", **wrong)], cache=False).failed
    assert words in failure["error"]


def test_a_damaged_truth_is_named(tmp_path):
    folder = write(tmp_path / "a")
    (folder / "groundtruth.txt").write_text("# nothing\n")
    loaded = load_recordings([folder], cache=False)
    assert [set(f.streams) for f in loaded.flights] == [{"imu"}]
    assert ["groundtruth.txt" in f["error"] for f in loaded.failed] == [True]

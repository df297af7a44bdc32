"""Tables of one flight, such as imu.csv and mocap.csv: one map, one recording, and never two flights in one."""

import numpy as np
import pytest

from nanobench_tools.errors import InputError
from nanobench_tools.signals.column_draft import draft_tables
from nanobench_tools.sources import load_recordings

IMU = ("imu", "t", ("gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y", "acc_z"))
POSES = ("mocap", "timestamp", ("x", "y", "z", "qx", "qy", "qz", "qw"))


def _write(folder, name, what, start_s, duration_s=8.0, step_s=0.01):
    _, time, columns = what
    t = np.arange(0.0, duration_s, step_s)
    move = np.stack([np.sin(t + k) for k in range(len(columns))], axis=1)
    if "acc_z" in columns:
        move[:, columns.index("acc_z")] += 9.81
    if what is POSES:
        move[:, 3:] = [0.0, 0.0, 0.0, 1.0]
    folder.mkdir(exist_ok=True)
    rows = [",".join([time, *columns]),
            *(",".join(f"{c:.6f}" for c in row) for row in np.column_stack([start_s + t, move]))]
    (folder / name).write_text("\n".join(rows) + "\n")
    return folder / name


def _map(tmp_path, *files):
    target = tmp_path / "map.toml"
    target.write_text(draft_tables(files).text)
    return target


def test_two_tables_are_one_recording(tmp_path):
    imu = _write(tmp_path / "a", "imu.csv", IMU, 1.7e9)
    mocap = _write(tmp_path / "a", "mocap.csv", POSES, 1.7e9 + 0.5, step_s=0.02)
    loaded = load_recordings([tmp_path / "a"], columns=_map(tmp_path, imu, mocap), cache=False)
    (flight,) = loaded.flights
    assert loaded.failed == []
    assert set(flight.streams) == {"imu", "mocap"}
    assert (flight["imu"].time_s[0], round(flight["mocap"].time_s[0], 6)) == (0.0, 0.5)
    assert flight["mocap"]["px"][10] == pytest.approx(np.sin(0.2), abs=1e-6)
    assert flight["imu"]["acc_z"][0] == pytest.approx(np.sin(5.0) + 9.81, abs=1e-6)
    assert flight.metadata["read_as"] == ["imu.csv and mocap.csv are one recording"]


def test_one_map_reads_every_pair_in_a_folder(tmp_path):
    folder = tmp_path / "all"
    for k, start in enumerate((0.0, 100.0)):
        files = [_write(folder, f"run{k}_{what[0]}.csv", what, start) for what in (IMU, POSES)]
    loaded = load_recordings([folder], columns=_map(tmp_path, *files), cache=False)
    assert [(f.name, len(f.streams)) for f in loaded.flights] == [("run0", 2), ("run1", 2)]
    assert loaded.failed == []


def test_a_table_that_is_not_there_is_stated(tmp_path):
    imu, mocap = (_write(tmp_path / "a", f"{w[0]}.csv", w, 0.0) for w in (IMU, POSES))
    columns = _map(tmp_path, imu, mocap)
    mocap.unlink()
    (flight,) = load_recordings([tmp_path / "a"], columns=columns, cache=False).flights
    assert flight.metadata["read_as"] == ["there is no table mocap.csv with it"]


def test_tables_at_other_times_are_refused(tmp_path):
    imu = _write(tmp_path / "a", "imu.csv", IMU, 0.0)
    mocap = _write(tmp_path / "a", "mocap.csv", POSES, 20.0)
    with pytest.raises(InputError, match=r"imu.csv ends 12 s before mocap.csv begins"):
        draft_tables((imu, mocap))
    _write(tmp_path / "a", "mocap.csv", POSES, 3.0)
    columns = _map(tmp_path, imu, mocap)
    _write(tmp_path / "a", "mocap.csv", POSES, 20.0)
    loaded = load_recordings([tmp_path / "a"], columns=columns, cache=False)
    assert loaded.flights == []
    assert "ends 12 s before mocap.csv begins" in loaded.failed[0]["error"]


@pytest.mark.parametrize("names", [("imu.csv", "imu2.csv"), ("vrpn_cf1.csv", "vrpn_cf2.csv")])
def test_two_of_one_kind_are_a_question(tmp_path, names):
    what = IMU if "imu" in names[0] else POSES
    files = [_write(tmp_path, name, what, 0.0) for name in names]
    with pytest.raises(InputError, match=f"both have {'p' * (what is POSES)}{what[2][0]} of {what[0]}"):
        draft_tables(files)


def test_gyro_and_accelerometer_in_two_tables_are_one_sensor(tmp_path):
    gyro = _write(tmp_path / "a", "gyro.csv", ("gyro", "t", IMU[2][:3]), 5.0)
    acc = _write(tmp_path / "a", "accel.csv", ("acc", "t", IMU[2][3:]), 5.003)
    loaded = load_recordings([tmp_path / "a"], columns=_map(tmp_path, gyro, acc), cache=False)
    (flight,) = loaded.flights
    imu = flight["imu"]
    assert set(imu.quantities) == set(IMU[2])
    since = imu.time_s + flight.epoch_s - 5.0
    assert np.abs(imu["gyro_y"] - np.sin(since + 1.0)).max() < 1e-4
    assert np.abs(imu["acc_z"] - 9.81 - np.sin(since - 0.003 + 2.0)).max() < 1e-4


def test_a_map_with_a_mistake_names_its_line(tmp_path):
    imu, mocap = (_write(tmp_path, f"{w[0]}.csv", w, 0.0) for w in (IMU, POSES))
    text = draft_tables((imu, mocap)).text
    at = text.splitlines().index('[table.streams.mocap]') + 1
    (tmp_path / "map.toml").write_text(text.replace('column = "x", unit = "m"', 'column = "x", unit = "yd"'))
    with pytest.raises(InputError, match=rf"line {at + 1}, streams.mocap.px.unit: unit 'yd'"):
        load_recordings([tmp_path], columns=tmp_path / "map.toml", cache=False)
    (tmp_path / "map.toml").write_text(text.replace('file = "mocap.csv"', 'file = "imu.csv"'))
    with pytest.raises(InputError, match="the name of each table once"):
        load_recordings([tmp_path], columns=tmp_path / "map.toml", cache=False)

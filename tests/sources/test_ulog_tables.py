"""Tables of ``ulog2csv`` give the flight of the log they were made from. pyulog writes them here."""

from __future__ import annotations

import numpy as np
import pytest
from test_ulog import T, position
from ulog_samples import ulog, yaw_right_of_north

from nanobench_tools.sources import load_recordings

ulog2csv = pytest.importorskip("pyulog.ulog2csv")
TOPICS = {
    "vehicle_local_position": [position(t, 1e-6 * (t - T[0]), 2.0, -1.0, (1.0, 0.0, 0.0)) for t in T],
    "vehicle_attitude": [(t, t, *yaw_right_of_north(1e-6 * (t - T[0]))) for t in T],
    "sensor_combined": [(t, 0.1, 0.2, 0.3, 0.0, 0.0, -9.81) for t in T],
    "actuator_motors": [(t, 0.1, 0.2, 0.3, 0.4, *[float("nan")] * 8) for t in T],
    "battery_status": [(t, 16.2) for t in T],
    "someone_elses": [(t, 1.0) for t in T],
}


def written(folder, name):
    folder.mkdir(exist_ok=True)
    (folder / f"{name}.ulg").write_bytes(ulog(TOPICS))
    ulog2csv.convert_ulog2csv(str(folder / f"{name}.ulg"), None, str(folder), ",", None, None)
    return folder / f"{name}.ulg"


def test_the_tables_of_each_log_are_the_flight_of_the_log(tmp_path):
    (log,) = load_recordings([written(tmp_path / "a", "first")], cache=False).flights
    written(tmp_path / "a", "second").unlink()
    (tmp_path / "a" / "first.ulg").unlink()
    loaded = load_recordings([tmp_path / "a"], cache=False)
    assert not loaded.failed
    assert [f.name for f in loaded.flights] == ["first", "second"]
    for flight in loaded.flights:
        assert set(flight.streams) == set(log.streams) >= {"imu", "motor", "estimator", "attitude_qw", "battery"}
        for name, stream in log.streams.items():
            assert flight[name].quantities == stream.quantities
            np.testing.assert_allclose(flight[name].values, stream.values, atol=1e-5)
            np.testing.assert_allclose(flight[name].time_s, stream.time_s, atol=1e-9)


def test_one_table_is_read_alone(tmp_path):
    written(tmp_path, "log_7_2026").unlink()
    (flight,) = load_recordings([tmp_path / "log_7_2026_vehicle_local_position_0.csv"], cache=False).flights
    assert set(flight.streams) == {"estimator", "estimator_acc"}
    np.testing.assert_allclose(flight["estimator"]["x", "z"], [[2.0, 1.0]] * len(T), atol=1e-6)

"""ROS bags written by rosbags' own writers, read without and with a column map; cut and damaged ones."""

from __future__ import annotations

import itertools
import math
import sys

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from nanobench_tools.errors import how_to_install
from nanobench_tools.sources import load_recordings

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
START_NS = 1_772_689_631_000_000_000
KINDS = ("ros1", "sqlite3", "mcap")
N = 40


def samples(store, i):
    """Topic -> message of step i (10 ms): stamps are 2 ms before the time of receiving."""
    t = store.types
    ros1 = store is ROS1
    stamp = t["builtin_interfaces/msg/Time"](1_772_689_631, 10_000_000 * i + 1_000_000)
    header = t["std_msgs/msg/Header"](*([i] if ros1 else []), stamp=stamp, frame_id="world")
    point, vector = t["geometry_msgs/msg/Point"], t["geometry_msgs/msg/Vector3"]
    half = math.pi / 4
    east_to_north = t["geometry_msgs/msg/Quaternion"](0.0, 0.0, math.sin(half), math.cos(half))
    pose = t["geometry_msgs/msg/Pose"](point(1.0, 2.0, 0.01 * i), east_to_north)
    twist = t["geometry_msgs/msg/Twist"](vector(0.5, 0.0, 1.0), vector(0.0, 0.0, 0.0))
    covariance = np.zeros(36)
    with_pose = t["geometry_msgs/msg/PoseWithCovariance"](pose, covariance)
    with_twist = t["geometry_msgs/msg/TwistWithCovariance"](twist, covariance)
    layout = t["std_msgs/msg/MultiArrayLayout"]([], 0)
    values = np.array([10.0 * i, 20.0, 30.0, 65535.0], np.float32)
    return {
        "/vicon/cf": t["geometry_msgs/msg/PoseStamped"](header, pose),
        "/odom": t["nav_msgs/msg/Odometry"](header, "body", with_pose, with_twist),
        "/imu": t["sensor_msgs/msg/Imu"](
            header, east_to_north, np.zeros(9), vector(0.1, 0.2, 0.3), np.zeros(9), vector(0.0, 0.0, 9.81), np.zeros(9)
        ),
        "/pwm": t["std_msgs/msg/Float32MultiArray"](layout, values),
    }


def write(folder, kind, topics=None, n=N, first=0, name="flight"):
    """A bag below ``folder`` with the steps from ``first`` to ``n``; the file that holds the messages."""
    store = ROS1 if kind == "ros1" else ROS2
    writer = (
        Writer1(folder / f"{name}.bag")
        if kind == "ros1"
        else Writer2(folder / name, version=9, storage_plugin=StoragePlugin[kind.upper()])
    )
    with writer:
        connections = {
            topic: writer.add_connection(topic, message.__msgtype__, typestore=store)
            for topic, message in samples(store, 0).items()
            if topics is None or topic in topics
        }
        for i in range(first, n):
            for topic, message in samples(store, i).items():
                if topic in connections:
                    serialize = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
                    raw = serialize(message, message.__msgtype__)
                    writer.write(connections[topic], START_NS + 10_000_000 * i + 3_000_000, raw)
    written = [folder / f"{name}.bag"] if kind == "ros1" else sorted((folder / name).iterdir())
    return next(path for path in written if path.suffix != ".yaml")


def one(folder, columns=None):
    loaded = load_recordings([folder], columns=columns, cache=False)
    assert loaded.failed == []
    (flight,) = loaded.flights
    assert flight.provenance.source == "rosbag"
    return flight


@pytest.mark.parametrize("kind", KINDS)
def test_common_types_are_read_as_they_are_meant(tmp_path, kind):
    write(tmp_path, kind)
    flight = one(tmp_path)
    assert set(flight.streams) == {"mocap", "estimator", "attitude_qw", "imu"}
    np.testing.assert_allclose(flight["mocap"]["px", "py"], [[1.0, 2.0]] * N)
    np.testing.assert_allclose(flight["mocap"]["pz"], 0.01 * np.arange(N))
    np.testing.assert_allclose(flight["mocap"]["qz", "qw"], [[math.sqrt(0.5)] * 2] * N)
    np.testing.assert_allclose(flight["imu"]["acc_z", "gyro_y"], [[9.81, 0.2]] * N)
    np.testing.assert_allclose(flight["estimator"]["vx", "vy", "vz"], [[0.0, 0.5, 1.0]] * N, atol=1e-12)
    np.testing.assert_allclose(flight["mocap"].time_s, 0.01 * np.arange(N), atol=1e-12)
    assert flight.epoch_s == pytest.approx(START_NS * 1e-9 + 0.001, abs=1e-6)
    assert flight["mocap"].rate_hz == pytest.approx(100.0)
    assert flight.provenance.findings == ()
    assert flight.provenance.notes == ("topic /pwm (std_msgs/msg/Float32MultiArray) is not read",)


MAP = """schema = "nanobench-columns/1"
[streams.motor]
m1 = {column = "/pwm.data", index = 0, unit = "pwm16"}
m4 = {column = "/pwm.data", index = 3, unit = "pwm16"}
[streams.imu]
gyro_z = {column = "/imu.angular_velocity.z", sign = -1}
[vehicle]
name = "custom"
"""


@pytest.mark.parametrize("kind", KINDS)
def test_column_map_names_topics_and_fields(tmp_path, kind):
    (tmp_path / "bags").mkdir()
    write(tmp_path / "bags", kind)
    (tmp_path / "columns.toml").write_text(MAP)
    flight = one(tmp_path / "bags", tmp_path / "columns.toml")
    np.testing.assert_allclose(flight["motor"]["m1"], 10.0 * np.arange(N) / 65535.0)
    np.testing.assert_allclose(flight["motor"]["m4"], 1.0)
    assert flight["motor"].columns == ("/pwm.data[0]", "/pwm.data[3]")
    np.testing.assert_allclose(flight["imu"]["gyro_z"], -0.3)
    np.testing.assert_allclose(flight["motor"].time_s - flight["imu"].time_s, 0.002, atol=1e-12)
    assert flight.metadata["vehicle"] == {"name": "custom"}
    assert flight.provenance.findings == ()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("/imu.angular_velocity.z", "/pwm.data.z", None),
        ("index = 3", "index = 9", None),
        ('"/pwm.data", index = 3', '"/other.data", index = 3', "streams.motor: comes from 2 topics"),
    ],
)
def test_maps_that_do_not_fit(tmp_path, old, new, words):
    (tmp_path / "bags").mkdir()
    write(tmp_path / "bags", "ros1", n=3)
    (tmp_path / "columns.toml").write_text(MAP.replace(old, new))
    loaded = load_recordings([tmp_path / "bags"], columns=tmp_path / "columns.toml", cache=False)
    if words:
        assert words in loaded.failed[0]["error"]
        return
    (fault,) = loaded.flights[0].provenance.findings
    assert fault.kind == "missing_column"


def test_a_bag_without_anything_known(tmp_path):
    write(tmp_path, "mcap", {"/pwm"}, n=3)
    (failure,) = load_recordings([tmp_path], cache=False).failed
    assert "the bag holds /pwm (std_msgs/msg/Float32MultiArray); name its topics in a column map" in failure["error"]


@pytest.mark.parametrize("kind", KINDS)
def test_cut_bags_keep_what_is_whole(tmp_path, kind):
    """A log of one topic, cut at several places: rows are the first ones of the whole log, the cut is reported."""
    data = write(tmp_path, kind, {"/imu"}, n=400).read_bytes()
    whole = 400
    (tmp_path / "cut").mkdir()
    rows = []
    for k, share in enumerate((0.3, 0.6, 0.9)):
        path = tmp_path / "cut" / f"{k}"
        path.write_bytes(data[: int(len(data) * share)])
        loaded = load_recordings([path], cache=False)
        assert len(loaded.flights) == 1, loaded.failed
        flight = loaded.flights[0]
        assert [f.kind for f in flight.provenance.findings] == ["truncated"]
        np.testing.assert_allclose(flight["imu"]["acc_z"], 9.81)
        np.testing.assert_allclose(flight["imu"].time_s, 0.01 * np.arange(len(flight["imu"])), atol=1e-9)
        rows.append(len(flight["imu"]))
    assert rows == sorted(rows)
    assert rows[0] > 0.1 * whole
    assert rows[1] > 0.35 * whole
    assert rows[2] > 0.5 * whole


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.slow
def test_broken_bags_end_in_a_flight_or_one_line(tmp_path, kind):
    data = write(tmp_path, kind, {"/imu", "/odom"}, n=5).read_bytes()
    rng = np.random.default_rng(3)
    (tmp_path / "broken").mkdir()
    for trial in range(8):
        mutated = bytearray(data)
        for at in rng.integers(16, len(mutated), 1 + trial % 4):
            mutated[at] ^= int(rng.integers(1, 256))
        path = tmp_path / "broken" / f"{trial}"
        path.write_bytes(mutated[: None if trial % 2 else int(rng.integers(16, len(mutated)))])
    loaded = load_recordings([tmp_path / "broken"], cache=False)
    assert len(loaded.flights) + len(loaded.failed) == 8
    assert len(loaded.flights) > 1
    for failure in loaded.failed:
        assert failure["path"] in failure["error"]
        assert "\n" not in failure["error"]
        assert "failed," not in failure["error"], "an exception that is no NanobenchError"


def split(folder, kind, edges=(0, 15, 30, N)):
    """One recording in numbered files without metadata.yaml, as a recorder that lost power leaves it."""
    (folder / "made").mkdir()
    (folder / "parts").mkdir()
    parts = []
    for k, (first, end) in enumerate(itertools.pairwise(edges)):
        made = write(folder / "made", kind, n=end, first=first, name=f"part{k}")
        parts.append(made.rename(folder / "parts" / f"x_{k + 8}{made.suffix}"))  # x_10 sorts before x_9
    return parts


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.slow
def test_files_of_a_split_recording_are_one_flight(tmp_path, kind):
    split(tmp_path, kind)
    flight = one(tmp_path / "parts")
    whole = one(write(tmp_path, kind))
    assert flight.epoch_s == whole.epoch_s
    for name, stream in whole.streams.items():
        np.testing.assert_array_equal(flight[name].time_s, stream.time_s)
        np.testing.assert_array_equal(flight[name].values, stream.values)
    assert "one recording in 3 files" in flight.provenance.notes


def test_a_split_recording_with_files_that_break_off(tmp_path):
    parts = split(tmp_path, "ros1", edges=(0, 130, 260, 400))
    parts[2].write_bytes(parts[2].read_bytes()[:-20_000])  # power was lost
    flight = one(tmp_path / "parts")
    assert 260 < len(flight["imu"]) < 400
    (found,) = [f.evidence for f in flight.provenance.findings if f.kind == "truncated"]
    assert "file 3 of 3: the bag is not whole" in found
    (tmp_path / "parts" / "metadata.yaml").write_text(
        f"rosbag2_bagfile_information:\n  relative_file_paths: [{', '.join(p.name for p in parts)}]\n")
    parts[1].write_bytes(parts[1].read_bytes()[:20])
    flight = one(tmp_path / "parts")
    (found,) = [f.evidence for f in flight.provenance.findings if f.kind == "truncated"]
    assert "file 2 of 3: cannot be read as a ROS bag" in found


def test_numbered_files_that_do_not_follow_each_other_are_flights(tmp_path):
    split(tmp_path, "ros1", edges=(0, 15, 15 + 200, 15 + 220))[1].unlink()
    (tmp_path / "parts" / "x_10.bag").rename(tmp_path / "parts" / "x_9.bag")
    assert [f.name for f in load_recordings([tmp_path / "parts"], cache=False).flights] == ["x_8", "x_9"]


@pytest.mark.slow
def test_metadata_of_rosbag2_lists_the_parts(tmp_path):
    parts = split(tmp_path, "mcap")
    names = [p.name for p in parts]
    (tmp_path / "parts" / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  version: 9\n  relative_file_paths:\n"
        + "".join(f"    - {name}\n" for name in names))
    assert len(one(tmp_path / "parts")["imu"]) == N
    parts[1].unlink()
    flight = one(tmp_path / "parts")
    assert len(flight["imu"]) == N - 15
    assert "metadata.yaml lists x_9.mcap, which is not there" in [f.evidence for f in flight.provenance.findings]


def test_an_sqlite_bag_without_its_last_page_is_reported(tmp_path):
    path = write(tmp_path, "sqlite3", {"/imu", "/odom"}, n=400)
    path.write_bytes(path.read_bytes()[:-200])
    assert "truncated" in {f.kind for f in one(path).provenance.findings}


def test_sqlite_file_that_is_no_bag(tmp_path):
    import sqlite3

    with sqlite3.connect(tmp_path / "a.db") as connection:
        connection.execute("CREATE TABLE other(x)")
    connection.close()
    (failure,) = load_recordings([tmp_path], cache=False).failed
    assert "cannot be read as a ROS bag" in failure["error"]


def test_missing_extra_is_one_line(tmp_path, monkeypatch):
    path = write(tmp_path, "ros1", n=1)
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    (failure,) = load_recordings([path], cache=False).failed
    assert failure["error"] == f"{path}: a ROS bag is read through rosbags; {how_to_install('rosbag')}"

"""Sources of poses: simulated over sockets, the package by a stand-in, a callable; and frames that are wrong."""

import socket
import sys
import time
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from nanobench_tools import so3
from nanobench_tools.errors import InputError, MissingExtraError, UsageError
from nanobench_tools.radio.fly import checklist
from nanobench_tools.radio.fly.pose_feed import Feed
from nanobench_tools.radio.fly.pose_tracker import PoseTrack
from nanobench_tools.radio.fly.safety import Limits
from nanobench_tools.radio.mocap.mocap_sources import pose_source
from nanobench_tools.radio.mocap.pose_datagram import Pose, pack
from nanobench_tools.radio.mocap.pose_source import checked, seen

UP = np.array([0.0, 0.0, 1.0])
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
URI = "udp://127.0.0.1:19850"
ANSWER_S = 60.0
"""A busy machine is slow, not wrong."""


def came(got: list[Pose], count: int) -> bool:
    """Waits for poses."""
    until = time.monotonic() + ANSWER_S
    while len(got) < count and time.monotonic() < until:
        time.sleep(0.005)
    return len(got) >= count


@pytest.mark.parametrize(("spec", "uri"), [
    ("nothing", URI), ("vicon://", URI), ("vicon://host", URI), ("simulated", "radio://0/80/2M"),
    ("no_such_module:thing", URI), ("simulated://host", URI)])
def test_a_source_that_cannot_be_is_a_usage_error(spec, uri):
    with pytest.raises(UsageError):
        pose_source(spec, uri)


def test_a_simulated_vehicle_without_a_port_is_named():
    with pytest.raises(UsageError, match=r"--uri udp://127\.0\.0\.1: give host and port, such as udp://"):
        pose_source("simulated", "udp://127.0.0.1")


def test_without_the_package_it_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "motioncapture", None)
    with pytest.raises(MissingExtraError, match=r'pip install .*\[mocap\]"'):
        pose_source("vicon://192.168.1.5/cf1", URI)


def test_simulated_poses_come_over_a_socket_and_the_subscription_is_renewed():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server:
        server.bind(("127.0.0.1", 0))
        server.settimeout(ANSWER_S)
        source = pose_source(f"simulated://127.0.0.1:{server.getsockname()[1]}", URI)
        got = []
        source.start(got.append)
        for _ in range(2):  # it asks again by itself
            _, viewer = server.recvfrom(100)
        server.sendto(pack(12.5, [1.0, 2.0, 3.0], LEVEL), viewer)
        assert came(got, 1)
        source.close()
    assert got[0].time_s == 12.5
    np.testing.assert_allclose(got[0].position_m, [1.0, 2.0, 3.0])


def stand_in(frames) -> ModuleType:
    module = ModuleType("motioncapture")
    waiting = iter(frames)

    class System:
        rigidBodies: dict = {}  # noqa: RUF012 - the package's own name

        def waitForNextFrame(self):
            self.rigidBodies = next(waiting)

    def connect(kind, settings):
        if kind != "vicon":
            raise RuntimeError("Unknown motion capture type!")
        assert settings == {"hostname": "10.0.0.1"}
        return System()

    module.connect = connect
    return module


def test_the_package_gives_bodies_by_name_and_nothing_when_unseen(monkeypatch):
    body = SimpleNamespace(position=[0.1, 0.2, 0.3], rotation=SimpleNamespace(x=0.0, y=0.0, z=1.0, w=0.0))
    monkeypatch.setitem(sys.modules, "motioncapture", stand_in([{"cf1": body}, {"other": body}]))
    source = pose_source("vicon://10.0.0.1/cf1", URI)
    got, before = [], time.time()
    source.start(got.append)
    assert came(got, 2)
    assert seen(got[0])
    np.testing.assert_allclose(got[0].quaternion, [0.0, 0.0, 1.0, 0.0])
    assert not seen(got[1])
    assert before <= got[0].time_s <= time.time()
    monkeypatch.setitem(sys.modules, "motioncapture", stand_in([]))
    with pytest.raises(InputError, match="Unknown motion capture type"):
        pose_source("kinect://10.0.0.1/cf1", URI).start(got.append)


class Node:
    """What a callable may return: it is told what is sent, and closed."""

    def __init__(self, emit) -> None:
        self.told, self.closed = [], False
        emit(1.0, (0.0, 0.0, 0.1), (0.0, 0.0, 0.0, 1.0))
        Node.last = self

    def setpoint(self, time_s, said) -> None:
        self.told.append((time_s, said["kind"]))

    def close(self) -> None:
        self.closed = True


def raises(emit) -> None:
    raise RuntimeError("no ROS")


def test_a_callable_feeds_poses_and_reads_what_is_sent(monkeypatch):
    monkeypatch.syspath_prepend(str(__import__("pathlib").Path(__file__).parent))
    source = pose_source("test_mocap_sources:Node", URI)
    sent = []
    link = SimpleNamespace(send_pose=lambda p, q: sent.append(p))
    feed = Feed(link, source)
    feed.feed = True
    feed.start()
    assert len(sent) == 1
    assert feed.track.newest.time_s == 1.0
    feed.sent(2.0, bytes([0]))
    feed.close()
    import test_mocap_sources as module

    assert module.Node.last.told == [(2.0, "stop")]
    assert module.Node.last.closed
    with pytest.raises(InputError, match="RuntimeError: no ROS"):
        pose_source("test_mocap_sources:raises", URI).start(sent.append)
    with pytest.raises(InputError, match=r"shapes \(2,\)"):
        checked("x", 1.0, (0.0, 0.0), LEVEL)
    with pytest.raises(InputError, match="no numbers"):
        checked("x", 1.0, "here", LEVEL)


@pytest.mark.parametrize(("position", "quaternion", "words"), [
    ((5.0, 20.0, 35.0), LEVEL, "millimetres"),
    ((3.0, 0.0, 0.0), LEVEL, "outside the fence"),
    ((0.0, 0.0, 0.0), so3.from_euler_zyx(np.pi, 0.0, 0.0), "z points down"),
    ((0.0, 0.0, 0.0), so3.from_euler_zyx(0.0, np.pi / 2, 0.0), "90 deg from gravity"),
    ((0.0, 0.0, 0.0), np.array([1.0, 0.0, 0.0, 0.0]), "z points down"),  # w first is read as x first
])
def test_a_wrong_frame_is_named_before_anything_is_armed(position, quaternion, words):
    with pytest.raises(InputError, match=words) as caught:
        checklist.check_frame("vicon", Pose(0.0, np.array(position), np.asarray(quaternion)), UP, Limits().fence)
    assert "not armed" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_right_frame_passes_however_the_vehicle_is_turned():
    for yaw in np.linspace(-3.0, 3.0, 7):
        tilted = so3.multiply(so3.from_euler_zyx(0.0, 0.0, yaw), so3.from_euler_zyx(0.05, -0.05, 0.0))
        checklist.check_frame("vicon", Pose(0.0, np.zeros(3), tilted), UP, Limits().fence)


def test_yaw_off_by_half_a_turn_is_named():
    checklist.check_yaw("vicon", 0.3, 0.0)
    checklist.check_yaw("vicon", np.pi - 0.1, -np.pi + 0.1)
    with pytest.raises(InputError, match="180 deg apart"):
        checklist.check_yaw("vicon", np.pi, 0.0)


def test_battery_supervisor_poses_and_tables_are_checked():
    for bad, words in ((lambda: checklist.check_battery("u", 3.4), "3.40 V at rest"),
                       (lambda: checklist.check_battery("u", float("nan")), "battery"),
                       (lambda: checklist.check_supervisor("u", 1 << 6), "locked"),
                       (lambda: checklist.check_supervisor("u", 1 << 5), "on its back"),
                       (lambda: checklist.check_supervisor("u", 0), "does not allow arming"),
                       (lambda: checklist.check_poses("u", None, 0, 2.0), "no pose"),
                       (lambda: checklist.check_poses("u", Pose(0.0, UP, LEVEL), 5, 2.0), "2 poses a second"),
                       (lambda: checklist.check_tables("u", set(), set(checklist.NEEDED_PARAMETERS)), "acc.x, acc.y")):
        with pytest.raises(InputError, match=words):
            bad()


def test_the_track_knows_place_speed_and_rates_of_a_turning_vehicle():
    track = PoseTrack()
    for t in np.arange(0.0, 0.3, 0.01):
        place = np.array([np.sin(2.0 * t), 1.0 - t, 0.5 * t * t])
        track.add(Pose(t, place, so3.from_euler_zyx(0.0, 0.0, 3.0 * t)))
    now = track.at(0.30)
    np.testing.assert_allclose(now.position_m, [np.sin(0.6), 0.7, 0.045], atol=2e-4)
    np.testing.assert_allclose(now.velocity_m_s, [2.0 * np.cos(0.6), -1.0, 0.3], atol=0.02)
    np.testing.assert_allclose(now.rate_rad_s, [0.0, 0.0, 3.0], atol=1e-6)
    assert now.yaw_rad == pytest.approx(0.9, abs=1e-6)
    assert not track.add(Pose(0.1, np.zeros(3), LEVEL))  # older than the newest
    assert not track.add(Pose(9.0, np.full(3, np.nan), LEVEL))
    assert PoseTrack().at(0.0) is None

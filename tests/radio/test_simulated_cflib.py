"""The unmodified cflib from PyPI cannot tell the served vehicle from a real one."""

import socket
import threading
import time
from contextlib import suppress

import cflib.crtp
import numpy as np
import pytest
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.commander import Commander
from cflib.crazyflie.log import LogConfig
from cflib.crazyflie.mem import MemoryElement, Poly4D, TrajectoryMemory
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie
from cflib.crtp import udpdriver
from cflib.positioning import motion_commander
from cflib.positioning.motion_commander import MotionCommander
from cflib.utils.encoding import compress_quaternion
from cflib_world import ANSWER_S, WorldTime, linked_to, until
from still_vehicle import StillVehicle

from nanobench_tools.radio.mocap.pose_datagram import unpack
from nanobench_tools.radio.simulated.channel import RadioOptions
from nanobench_tools.radio.simulated.quaternion32 import compress
from nanobench_tools.radio.simulated.server import SimulatedCrazyflie

pytestmark = pytest.mark.usefixtures("cflib_drivers")


def logged(scf: SyncCrazyflie, names: list[str], period_ms: int = 10) -> list[tuple[int, dict]]:
    """Starts a block; the list grows as packets come."""
    block, rows = LogConfig("test", period_ms), []
    for name in names:
        block.add_variable(name)
    block.data_received_cb.add_callback(lambda tick, data, _: rows.append((tick, data)))
    scf.cf.log.add_config(block)
    block.start()
    return rows


def test_it_connects_reads_all_parameters_logs_and_takes_trajectories() -> None:
    with SimulatedCrazyflie(StillVehicle()) as served, linked_to(served) as scf:
        cf, onboard = scf.cf, served.simulation.onboard
        assert cf.platform.get_protocol_version() == 10
        assert float(cf.param.get_value("pid_rate.roll_kp")) == 250.0
        cf.param.set_value("stabilizer.controller", 2)
        cf.param.set_value("locSrv.extPosStdDev", 0.003)
        told: list[bool] = []
        cf.param.persistent_store("pid_rate.roll_kp", lambda name, good: told.append(good))
        states: list = []
        cf.param.persistent_get_state("pid_rate.roll_kp", lambda name, state: states.append(state))
        rows = logged(scf, ["stateEstimate.x", "motor.m1", "pm.vbat", "stabilizer.roll", "acc.z", "gyro.x"])
        assert until(lambda: told and states and len(rows) >= 20)
        assert until(lambda: onboard.selection.controller == 2)
        assert until(lambda: onboard.localization.position_sd_m == pytest.approx(0.003))
        assert told == [True]
        assert states[0].is_stored
        assert states[0].default_value == 250.0
        assert set(np.diff([tick for tick, _ in rows])) == {10}
        assert rows[0][1]["pm.vbat"] == pytest.approx(3.7)
        assert rows[0][1]["acc.z"] == 1.0
        a_trajectory_is_flown(served, cf)


def a_trajectory_is_flown(served: SimulatedCrazyflie, cf: Crazyflie) -> None:
    """One of 0.5 m/s along x, uploaded and begun: where it asks the vehicle to be."""
    memory = cf.mem.get_mems(MemoryElement.TYPE_TRAJ)[0]
    assert isinstance(memory, TrajectoryMemory)
    memory.trajectory = [Poly4D(60.0, x=Poly4D.Poly([0.0, 0.5] + 6 * [0.0]), z=Poly4D.Poly([1.0] + 7 * [0.0]))]
    assert memory.write_data_sync()
    high, onboard = cf.high_level_commander, served.simulation.onboard
    high.define_trajectory(1, 0, 1)
    high.takeoff(0.5, 0.2)
    assert until(lambda: onboard.high_level.status[0])
    high.start_trajectory(1, 1.0, relative_position=False)
    assert until(lambda: onboard.commander.setpoint["velocity_m_s"][0, 0] == pytest.approx(0.5))
    since_s, wanted = onboard.high_level._elapsed_s, onboard.commander.setpoint["position_m"][0].copy()
    assert wanted[2] == pytest.approx(1.0)
    assert wanted[0] == pytest.approx(0.5 * since_s, abs=0.02)  # the vehicle goes on between the two


def test_a_poor_link_connects_too() -> None:
    radio = RadioOptions(latency_s=0.002, jitter_s=0.001, loss=0.1, packets_per_s=900.0, seed=1)
    with SimulatedCrazyflie(StillVehicle(), radio=radio) as served, linked_to(served) as scf:
        assert len(scf.cf.param.values) > 10


def test_a_scan_finds_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(udpdriver, "_SCAN_TIMEOUT", ANSWER_S)
    for port in range(19859, 19849, -1):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
        with SimulatedCrazyflie(StillVehicle(), port=port) as served:
            assert [served.uri, ""] in cflib.crtp.scan_interfaces()
            return
    pytest.skip("ALL TEN PORTS TAKEN that cflib scans")


class Recorded:
    """Stands in for the Crazyflie of a cflib commander: what it would send."""

    def __init__(self) -> None:
        self.sent: list = []
        self.platform = self

    def get_protocol_version(self) -> int:
        return 10

    def send_packet(self, packet) -> None:
        self.sent.append((packet.port, packet.channel, bytes(packet.data)))


def test_setpoints_of_the_library_are_understood() -> None:
    from nanobench_tools.radio.simulated import setpoints

    link = Recorded()
    commander = Commander(link)
    turned = (0.1, -0.2, 0.3, float(np.sqrt(1 - 0.14)))
    commander.send_full_state_setpoint((1, -2, 0.5), (0.1, 0, 0), (0, 0, 0.2), turned, 1.0, 0.5, -0.25)
    commander.send_position_setpoint(1, 2, 3, 45)
    commander.send_hover_setpoint(0.1, 0.2, 30, 0.8)
    commander.send_velocity_world_setpoint(0.1, 0.2, 0.3, 30)
    commander.send_zdistance_setpoint(1, 2, 30, 0.8)
    commander.send_setpoint_manual(10, 20, 30, 50, True)
    commander.send_stop_setpoint()
    full, place, hover, speed, height, manual, stop = (setpoints.generic(data)[0] for _, _, data in link.sent)
    assert full["position_m"] == pytest.approx((1, -2, 0.5))
    assert full["rate_deg_s"] == pytest.approx(np.degrees((1.0, 0.5, -0.25)), rel=1e-4)
    assert full["quaternion"] == pytest.approx(turned, abs=3e-3)
    assert compress(turned) == compress_quaternion(turned)
    assert place["attitude_deg"][2] == 45
    assert (hover["velocity_body"], hover["rate_deg_s"][2]) == (1, 30)
    assert speed["velocity_m_s"] == pytest.approx((0.1, 0.2, 0.3))
    assert (height["attitude_deg"][0], height["position_m"][2]) == (1, pytest.approx(0.8))
    assert manual["rate_deg_s"].tolist() == [10, -20, 30]
    assert not any(stop[name] for name in ("mode_x", "mode_z", "thrust"))
    commander.send_setpoint(3, 4, 50, 0)
    old = setpoints.RollPitchYawThrust().read(link.sent[-1][2])[0]
    assert old["attitude_deg"][:2].tolist() == [3, -4]
    assert old["rate_deg_s"][2] == -50


def feed(served: SimulatedCrazyflie, cf: Crazyflie, done: threading.Event) -> None:
    """Poses of the simulated cameras into the vehicle, as a lab's own program does it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as cameras:
        cameras.settimeout(0.5)
        asked = 0.0
        while not done.is_set():
            if time.monotonic() - asked > 1.0:
                cameras.sendto(b"?", served.mocap_address)
                asked = time.monotonic()
            with suppress(TimeoutError):
                pose = unpack(cameras.recv(64))
                cf.extpos.send_extpose(*pose.position_m, *pose.quaternion)


def test_it_takes_off_is_moved_about_and_lands(monkeypatch: pytest.MonkeyPatch) -> None:
    from controllers.plants.served_vehicle import served as vehicle

    own = vehicle()
    with SimulatedCrazyflie(own) as served, linked_to(served) as scf:
        world = WorldTime(served)
        monkeypatch.setattr(motion_commander, "time", world)
        done = threading.Event()
        feeding = threading.Thread(target=feed, args=(served, scf.cf, done))
        feeding.start()
        try:
            world.sleep(0.3)
            rows = logged(scf, ["stateEstimate.x", "stateEstimate.y", "stateEstimate.z", "supervisor.info"], 20)
            with MotionCommander(scf, default_height=0.4) as moving:
                world.sleep(0.4)
                since_s = world.time()
                moving.forward(0.3, velocity=0.4)
                moved_m = 0.4 * (world.time() - since_s)  # a busy machine ends it later
                assert own.true_pose()[0][2] > 0.25
                world.sleep(0.3)
                there = own.true_pose()[0].copy()
            assert until(lambda: own.true_pose()[0][2] < 0.05)
        finally:
            done.set()
            feeding.join()
    assert there[0] == pytest.approx(moved_m, abs=0.15)
    assert abs(there[1]) < 0.1
    assert any(int(row["supervisor.info"]) & 1 << 4 for _, row in rows)
    assert served.broken is None

"""The served vehicle: its physics against the plant's own, its loop against other code, and flights behind packets."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from scipy.signal import butter, lfilter
from scipy.spatial.transform import Rotation

from controllers.plants.plant import Plant
from controllers.plants.served_loop import touch
from controllers.plants.served_vehicle import ServedVehicle, served, served_simulator
from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.firmware.stabilizer import Stabilizer, believe, sense
from nanobench_tools.physics.batched import LANES
from nanobench_tools.physics.model import ROTOR
from nanobench_tools.physics.simulator import loads
from nanobench_tools.practice.rigid_bodies import legs
from nanobench_tools.practice.vehicle_parameters import OPEN_CIRCUIT, VEHICLE
from nanobench_tools.radio.crtp import Packet
from nanobench_tools.radio.simulated.onboard_services import Build, Onboard
from nanobench_tools.radio.simulated.supervisor import State


class Cell:
    """The battery once more, with NumPy."""

    def __init__(self, volts: float) -> None:
        self.charge = np.interp(volts, OPEN_CIRCUIT[:, 1], OPEN_CIRCUIT[:, 0])

    def volts(self, time_s: float, motor: np.ndarray) -> np.ndarray:
        conductance, load = VEHICLE["motor_conductance_A_V"].value, (motor**2).sum(axis=0)
        open_V = np.interp(self.charge, OPEN_CIRCUIT[:, 0], OPEN_CIRCUIT[:, 1])
        found = open_V / (1.0 + VEHICLE["resistance_ohm"].value * conductance * load)
        self.charge -= 0.001 * conductance * found[0] * load[0] / VEHICLE["capacity_A_s"].value
        return found


@pytest.mark.parametrize("delay_s", [None, 0.0125])
def test_the_physics_are_the_plants(delay_s: float | None) -> None:
    model = loads(served_simulator())
    if delay_s is not None:
        model = model.with_term("command_delay", delay_s=delay_s)
    vehicle = ServedVehicle(model, battery_V=4.0, noise=0.0, air=0.0)
    vehicle.place((0.0, 0.0, 5.0), 0.3, ground_m=-100.0)
    loop = vehicle.stabilizer.loop
    loop["override"] = 1
    start = np.zeros((1, 13))
    start[0, 2], start[0, 6:10] = 5.0, so3.exp(np.array([0.0, 0.0, 0.3]))
    past = 0.8  # what was commanded before the delay began
    vehicle._waiting[:] = past
    plant = Plant(model, start, np.full((1, 4), past), Cell(4.0), step_s=0.001)
    plant.state[ROTOR] = 0.0
    plant.battery.charge = np.interp(4.0, OPEN_CIRCUIT[:, 1], OPEN_CIRCUIT[:, 0])
    counts = np.random.default_rng(2).integers(45000, 62000, (60, 4))
    for row in counts:
        loop["direct"][0] = row
        vehicle.advance(10)
        for _ in range(10):
            plant.advance(row[None] / 65535.0)
    position, velocity, _ = vehicle.true_pose()
    assert position == pytest.approx(plant.state[:3, 0], abs=1e-9)
    assert velocity == pytest.approx(plant.state[3:6, 0], abs=1e-9)
    assert vehicle.rate_rad_s == pytest.approx(plant.state[10:13, 0], abs=1e-8)
    assert vehicle.battery_V == pytest.approx(plant.battery_V[0], abs=1e-9)
    assert abs(velocity[2]) > 0.05


@pytest.mark.slow
def test_legs_push_as_those_of_the_practice_vehicle() -> None:
    vehicle = served()
    world = vehicle._world
    world["ground_z"] = 0.0
    for depth, speed in ((0.001, (0.1, -0.2, -0.3)), (0.0005, (0.0, 0.3, 0.2)), (-0.001, (1.0, 1.0, 1.0))):
        x = np.zeros((17, LANES))
        x[2], x[9] = -depth, 1.0
        x[3:6] = np.array(speed)[:, None]
        force = np.zeros(3)
        touch(world[0], x, force)
        wanted = world["mass_kg"][0] * legs(np.array([depth]), np.array(speed)[:, None])[:, 0]
        assert force == pytest.approx(wanted if depth > 0 else np.zeros(3), abs=1e-12)


def test_the_imus_low_passes_are_butterworth() -> None:
    rng = np.random.default_rng(0)
    acc, gyro = rng.standard_normal((300, 3)), rng.standard_normal((300, 3))
    stabilizer = Stabilizer()
    found = np.zeros((300, 2, 3))
    for k in range(300):
        sense(stabilizer.loop[0], acc[k], gyro[k])
        found[k] = stabilizer.loop["acc_g"][0], stabilizer.loop["gyro_deg_s"][0]
    for which, (raw, corner) in enumerate(((acc, 30.0), (gyro, 80.0))):
        b, a = butter(2, corner, fs=1000.0)
        assert found[:, which] == pytest.approx(lfilter(b, a, raw, axis=0), abs=1e-5)


def test_what_is_believed_is_what_the_filter_says() -> None:
    stabilizer = Stabilizer()
    core = stabilizer.task["core"]
    q = so3.exp(np.array([0.3, -0.4, 1.2]))
    core["quaternion"][0] = q[[3, 0, 1, 2]]
    core["rotation"][0] = np.stack([so3.rotate(q, axis) for axis in np.eye(3)], axis=-1)
    core["state"][0] = (1.0, 2.0, 3.0, 0.1, -0.2, 0.3, 0.0, 0.0, 0.0)
    stabilizer.loop["acc_g"][0] = (0.1, -0.2, 0.9)
    believe(stabilizer.loop[0], stabilizer.task[0]["core"])
    estimate = stabilizer.loop["estimate"]
    yaw, pitch, roll = Rotation.from_quat(q).as_euler("ZYX", degrees=True)
    assert estimate["position_m"][0] == pytest.approx([1.0, 2.0, 3.0], abs=1e-6)
    assert estimate["velocity_m_s"][0] == pytest.approx(so3.rotate(q, np.array([0.1, -0.2, 0.3])), abs=1e-6)
    assert estimate["attitude_deg"][0] == pytest.approx([roll, -pitch, yaw], abs=1e-4)  # the firmware's pitch: nose up
    assert estimate["quaternion"][0] == pytest.approx(q, abs=1e-6)
    pull = so3.rotate(q, np.array([0.1, -0.2, 0.9])) - np.array([0.0, 0.0, 1.0])
    assert stabilizer.loop["acceleration_g"][0] == pytest.approx(pull, abs=1e-6)


class Flight:
    """A served vehicle with a deck, in the air or on the ground, on its own clock."""

    def __init__(self, **settings) -> None:
        self.vehicle = served(**settings)
        self.onboard = Onboard(self.vehicle, Build(positioning=True))
        self.onboard.advance(2000)

    def send(self, port: int, data: bytes, seconds: float, channel: int = 0) -> np.ndarray:
        """The packet every 20 ms for so long; position, velocity, quaternion at the end (10,)."""
        for _ in range(round(seconds / 0.02)):
            self.onboard.receive(Packet(port, channel, data))
            self.onboard.advance(self.onboard.tick_ms + 20)
        return np.concatenate(self.vehicle.true_pose())

    def hovering(self) -> Flight:
        self.send(7, struct.pack("<B4f", 7, 0.0, 0.0, 1.0, 0.0), 6.0)
        return self

    @property
    def attitude_deg(self) -> np.ndarray:
        """Roll, pitch (FLU), yaw, true."""
        return np.degrees(so3.euler_zyx(self.vehicle.true_pose()[2]))


@pytest.fixture(scope="module")
def hovered() -> Flight:
    return Flight().hovering()


def test_the_onboard_pid_holds_a_place(hovered: Flight) -> None:
    got = hovered.send(7, struct.pack("<B4f", 7, 0.5, -0.3, 1.0, 30.0), 4.0)
    assert got[:2] == pytest.approx([0.5, -0.3], abs=0.08)
    assert got[2] == pytest.approx(1.0, abs=0.2)  # its integral was filled by the ground
    assert hovered.attitude_deg[2] == pytest.approx(30.0, abs=4.0)
    assert hovered.onboard.supervisor.state == State.FLYING
    estimate = hovered.vehicle.stabilizer.loop["estimate"][0]
    assert estimate["position_m"] == pytest.approx(got[:3], abs=0.03)


@pytest.mark.parametrize(("data", "slot", "value", "within"), [
    (struct.pack("<B4f", 8, 0.3, 0.0, 0.0, 0.0), 3, 0.3, 0.1),
    (struct.pack("<B4f", 8, 0.0, -0.3, 0.0, 0.0), 4, -0.3, 0.1),
    (struct.pack("<B4f", 10, 0.0, 0.0, 0.0, 1.3), 2, 1.3, 0.15),
    (struct.pack("<B4f", 9, 0.0, 0.0, 0.0, 1.1), 2, 1.1, 0.2),
])
def test_velocity_hover_and_height_setpoints(hovered: Flight, data: bytes, slot: int, value: float,
                                             within: float) -> None:
    hovered.send(7, struct.pack("<B4f", 7, 0.0, 0.0, 1.0, 0.0), 2.0)
    assert hovered.send(7, data, 1.5)[slot] == pytest.approx(value, abs=within)


def test_angles_and_rates_over_the_old_port(hovered: Flight) -> None:
    hovered.send(7, struct.pack("<B4f", 7, 0.0, 0.0, 1.0, 0.0), 2.0)
    thrust = int(hovered.vehicle.stabilizer.loop["control"]["thrust"][0])
    hovered.onboard.receive(Packet(3, 0, struct.pack("<fffH", 0.0, 0.0, 0.0, 0)))
    hovered.send(3, struct.pack("<fffH", 8.0, -5.0, 0.0, thrust), 0.6)
    assert hovered.attitude_deg[:2] == pytest.approx([8.0, 5.0], abs=2.5)
    hovered.send(7, struct.pack("<B4f", 7, 0.0, 0.0, 1.0, 0.0), 3.0)
    hovered.onboard.params.set("flightmode.stabModeRoll", 0)
    hovered.onboard.params.set("flightmode.stabModePitch", 0)
    hovered.send(3, struct.pack("<fffH", 60.0, 0.0, 0.0, thrust), 0.24)
    assert np.degrees(hovered.vehicle.rate_rad_s[0]) == pytest.approx(60.0, abs=20.0)
    hovered.onboard.params.set("flightmode.stabModeRoll", 1)
    hovered.onboard.params.set("flightmode.stabModePitch", 1)
    hovered.send(7, struct.pack("<B4f", 7, 0.0, 0.0, 1.0, 0.0), 3.0)


def test_mellinger_and_lee_hold_a_place(hovered: Flight) -> None:
    for controller in (2, 5):
        hovered.send(7, struct.pack("<B4f", 7, 0.0, 0.0, 1.0, 0.0), 2.0)
        hovered.onboard.params.set("stabilizer.controller", controller)
        if controller == 2:
            hovered.onboard.params.set("ctrlMel.mass", 0.0408)
        else:
            hovered.onboard.params.set("ctrlLee.mass", 0.0408)
        got = hovered.send(7, struct.pack("<B4f", 7, 0.0, 0.0, 1.0, 0.0), 4.0)
        assert got[:3] == pytest.approx([0.0, 0.0, 1.0], abs=0.2), controller
    hovered.onboard.params.set("stabilizer.controller", 1)


def test_an_abandoned_vehicle_levels_out_falls_and_stays_on_the_ground() -> None:
    flight = Flight().hovering()
    flight.send(7, struct.pack("<B4f", 8, 0.5, 0.0, 0.0, 0.0), 1.0)
    flight.onboard.advance(flight.onboard.tick_ms + 1500)
    assert flight.onboard.supervisor.state == State.WARNING_LEVEL_OUT
    assert np.abs(flight.attitude_deg[:2]).max() < 4.0
    flight.onboard.advance(flight.onboard.tick_ms + 3000)
    position, velocity, _ = flight.vehicle.true_pose()
    assert flight.onboard.supervisor.state == State.LOCKED
    assert position[2] == pytest.approx(0.0, abs=0.005)
    assert np.linalg.norm(velocity) < 0.02
    assert not flight.vehicle.stabilizer.loop["motor"].any()


def test_a_weak_motor_is_felt_and_not_shown() -> None:
    model = loads(served_simulator()).with_term("motor_imbalance", g=(0.85, 1.05, 1.05, 1.05))
    flight = Flight.__new__(Flight)
    flight.vehicle = ServedVehicle(model)
    flight.onboard = Onboard(flight.vehicle, Build(positioning=True))
    flight.onboard.advance(2000)
    flight.hovering()
    motor = flight.vehicle.stabilizer.loop["motor"][0]
    assert motor[0] > 1.04 * motor[2]


def test_wind_leans_it_and_the_cell_sags() -> None:
    flight = Flight(wind_m_s=(1.5, 0.0, 0.0), battery_V=3.9).hovering()
    assert flight.attitude_deg[1] < -1.5  # nose up: its thrust leans against the push
    assert flight.vehicle.battery_V < 3.6
    assert flight.vehicle.stabilizer.loop["vbat_V"][0] == pytest.approx(flight.vehicle.battery_V, abs=0.05)


def test_at_rest_the_imu_shows_gravity_and_the_recorded_noise() -> None:
    vehicle = served()
    vehicle.advance(500)
    rows = []
    for _ in range(1000):
        vehicle.advance(10)
        loop = vehicle.stabilizer.loop[0]
        rows.append([*loop["acc_g"], *np.radians(loop["gyro_deg_s"])])
    mean, sd = np.mean(rows, axis=0), np.std(rows, axis=0)
    assert mean == pytest.approx([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], abs=0.01)
    assert sd[:3] * 9.81 == pytest.approx(VEHICLE["acc_noise_m_s2"].value, rel=0.2)
    assert sd[3:] == pytest.approx(VEHICLE["gyro_noise_rad_s"].value, rel=0.2)


def test_the_same_seed_flies_the_same() -> None:
    ends = [Flight(seed=seed).send(7, struct.pack("<B4f", 7, 0.0, 0.0, 0.5, 0.0), 2.0) for seed in (5, 5, 6)]
    assert (ends[0] == ends[1]).all()
    assert (ends[0] != ends[2]).any()


def test_a_restarted_vehicle_is_as_new() -> None:
    vehicle = served(start_m=(1.0, 2.0, 0.1), yaw_rad=0.5, battery_V=4.1)
    vehicle.stabilizer.loop["override"] = 1
    vehicle.stabilizer.loop["direct"] = 60000
    vehicle.advance(700)
    assert vehicle.true_pose()[0][2] > 0.2
    vehicle.restart()
    vehicle.advance(300)
    assert vehicle.true_pose()[0] == pytest.approx([1.0, 2.0, 0.1], abs=2e-3)
    assert vehicle.battery_V == pytest.approx(4.1, abs=0.02)


@pytest.mark.parametrize("bad", [{"battery_V": 2.0}, {"battery_V": float("nan")}, {"battery_V": 5.0}])
def test_impossible_batteries_are_refused(bad: dict) -> None:
    with pytest.raises(InputError):
        served(**bad)

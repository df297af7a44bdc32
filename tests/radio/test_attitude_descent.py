"""Without poses and without an estimate to trust, a vehicle comes down by attitude and thrust alone.

Flights are on the simulated vehicle's own clock, through cflib, at 1 m/s (SYNTHETIC).
"""

import numpy as np
import pytest
from faulty_world import ROOM
from toy_vehicle import Notes, Toy

from controllers.plants.served_vehicle import served
from nanobench_tools import so3
from nanobench_tools.cli.flights.flight_controllers import pilot_for
from nanobench_tools.radio.fly import setpoint_packets
from nanobench_tools.radio.fly.attitude_descent import BLIND_SHARE, LEAST_SHARE, LOW_SHARE, SETTLES_S, command
from nanobench_tools.radio.fly.dead_reckoning import IMU, PLACE, SPEED, THRUST, TURN, DeadReckoning
from nanobench_tools.radio.fly.flight_plan import chosen_path
from nanobench_tools.radio.fly.mission import Flight
from nanobench_tools.radio.fly.pose_tracker import Believed
from nanobench_tools.radio.fly.safety import Limits
from nanobench_tools.radio.fly.safety_handover import EVERY_S
from nanobench_tools.radio.fly.session import Request, fly_session
from nanobench_tools.radio.fly.virtual import VirtualWorld
from nanobench_tools.radio.simulated.channel import RadioOptions

ALL = ("onboard_pid", "onboard_mellinger", "mellinger_full", "geometric", "lqr", "mpc_daqp", "mpc_osqp", "nmpc")
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])


class LostWorld(VirtualWorld):
    """Poses end ``after_s`` in the air, and the vehicle's filter is reset at that moment: it believes to stand still,
    level. ``begun_m``, ``begun_m_s``: where the vehicle was and how fast; ``places_m``: afterwards; ``off_m``: height
    at which the motors stopped last."""

    def __init__(self, after_s: float = 8.0) -> None:
        super().__init__(served(), RadioOptions(latency_s=0.010), ROOM)
        self._after_s, self._high_s = after_s, np.inf
        self.begun_m = self.begun_m_s = None
        self.places_m: list[np.ndarray] = []
        self.off_m, self.sank_m_s = np.inf, 0.0

    def _step(self, time_s: float) -> None:
        super()._step(time_s)
        vehicle = self.simulation.onboard.vehicle
        place, velocity, _ = vehicle.true_pose()
        if place[2] > 0.8:
            self._high_s = min(self._high_s, time_s)
        if self.begun_m is None and time_s - self._high_s > self._after_s:
            self.begun_m, self.begun_m_s, self.blind = place, velocity, True
            vehicle.stabilizer.task["reset"] = 1
        if self.begun_m is not None:
            self.places_m.append(place)
            self.sank_m_s = max(self.sank_m_s, -float(velocity[2]))
            if vehicle.stabilizer.loop["motor"].any():
                self.off_m = float(place[2])


@pytest.mark.slow
@pytest.mark.parametrize("controller", ALL)
def test_a_vehicle_that_lost_poses_and_estimate_comes_down_near_where_it_was(short_phases, controller):
    """By its own planner it gets 2.2 to 2.5 m further, as its estimate has lost the speed."""
    world = LostWorld(after_s=4.5)
    path = chosen_path("circle", 1.0, 0.6, 8.0)
    with world.served() as uri:
        outcome = fly_session(Request(path, pilot_for(controller, None, None), Limits(), uri, world, (),
                                      clock=world)).outcome
    world.sleep_until(world.now() + 1.0)
    assert outcome.stop.rule in ("estimate", "stale pose")  # by size of what the filter has lost
    assert np.linalg.norm(world.begun_m_s) > 0.8
    further = np.linalg.norm(np.array(world.places_m)[:, :2] - world.begun_m[:2], axis=1).max()
    assert further < (2.5 if pilot_for(controller, None, None).kind in ("position", "full-state") else 0.8)
    assert max(place[2] for place in world.places_m) < world.begun_m[2] + 0.1
    assert world.off_m < 0.1
    assert world.sank_m_s < 1.0
    assert not world.simulation.onboard.supervisor.motors_allowed or not world.simulation.onboard.supervisor.flying


def believed(time_s: float, place, speed, turn=LEVEL, rate=(0.0, 0.0, 0.0)) -> Believed:
    return Believed(time_s, np.array(place, float), np.array(speed, float), np.asarray(turn), np.array(rate, float),
                    time_s)


def logged(now_s: float, *, acc=(0.0, 0.0, 1.0), gyro=(0.0, 0.0, 0.0), place=(0.0, 0.0, 1.0), speed=(0.0, 0.0, 0.0),
           turn=LEVEL, thrust=40000.0):
    values = dict(zip((*IMU, *PLACE, *SPEED, *TURN, THRUST), (*acc, *gyro, *place, *speed, *turn, thrust), strict=True))
    return values, dict.fromkeys(values, now_s)


def test_dead_reckoning_follows_gyro_and_accelerometer_after_the_last_pose():
    state = DeadReckoning(ground_m=0.0)
    acc = (0.0, 0.0, 1.0)
    state.update(10.0, believed(10.0, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)), *logged(10.0, acc=acc, speed=(1.0, 0.0, 0.0)))
    for k in range(1, 101):  # turns by 90 deg about z in 1 s, while it is pushed by .1 g along its nose
        state.update(10.0 + 0.01 * k, None, *logged(10.0 + 0.01 * k, acc=(0.1, 0.0, 1.0), gyro=(0.0, 0.0, 90.0),
                                                    place=state.position_m, speed=state.velocity_m_s,
                                                    turn=state.quaternion))
    assert so3.euler_zyx(state.quaternion)[2] == pytest.approx(np.pi / 2.0)
    gained = 0.981 * 2.0 / np.pi  # of a quarter turn in 1 s
    np.testing.assert_allclose(state.velocity_m_s, [1.0 + gained, gained, 0.0], atol=0.01)
    assert state.blind_s == pytest.approx(1.0)
    assert state.fault == ""
    assert state.hover_counts == pytest.approx(40000.0)


def test_an_estimate_that_has_lost_speed_or_attitude_is_found_and_a_good_one_is_not():
    for own, words in (({"speed": (1.0, 0.0, 0.0)}, ""), ({}, "velocity is 1.00 m/s from what its IMU shows"),
                       ({"speed": (1.0, 0.0, 0.0), "place": (2.0, 0.0, 1.0)}, "estimate is 2.0"),
                       ({"speed": (1.0, 0.0, 0.0), "turn": so3.exp(np.array([0.4, 0.0, 0.0]))}, "attitude is 23 deg"),
                       ({"turn": np.full(4, np.nan)}, "not a number")):
        state = DeadReckoning()
        state.update(10.0, believed(10.0, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)), *logged(10.0, **own))
        assert words in state.fault
        assert bool(words) == bool(state.fault)


def test_the_descent_brakes_against_the_speed_and_is_level_afterwards():
    state = DeadReckoning(hover_counts=40000.0, imu_s=0.0, velocity_m_s=np.array([0.0, 1.0, -0.4]),
                          quaternion=so3.from_euler_zyx(0.0, 0.0, np.pi / 2.0))  # flies the way it looks
    braking = setpoint_packets.decoded(command(state, 0.0))
    roll, pitch = np.degrees(braking["attitude_rad"])
    assert braking["kind"] == "attitude"
    assert roll == pytest.approx(0.0, abs=0.1)
    assert pitch == pytest.approx(-np.degrees(np.arctan(2.5 / 9.80665)), abs=0.1)  # nose up
    assert braking["thrust_counts"] == pytest.approx(40000, abs=10)
    np.testing.assert_allclose(setpoint_packets.decoded(command(state, 2.0))["attitude_rad"], 0.0, atol=1e-3)
    np.testing.assert_allclose(setpoint_packets.decoded(command(state, 0.0, brakes=False))["attitude_rad"], 0.0,
                               atol=1e-3)
    state.turn = so3.exp(np.array([0.1, 0.0, 0.0]))  # believes to be level while it rolls by .1
    tilt = setpoint_packets.decoded(command(state, 2.0))["attitude_rad"]
    assert np.linalg.norm(tilt) == pytest.approx(0.1, abs=1e-3)
    state.velocity_m_s = np.array([0.0, 0.0, 2.0])
    assert setpoint_packets.decoded(command(state, 2.0))["thrust_counts"] == round(LEAST_SHARE * 40000)
    state.velocity_m_s, state.position_m = np.array([0.0, 0.0, -2.0]), np.array([0.0, 0.0, 0.02])
    assert setpoint_packets.decoded(command(state, 2.0, ground_m=0.0))["thrust_counts"] == round(LOW_SHARE * 40000)
    state.imu_s = 1.0
    blind = setpoint_packets.decoded(command(state, 0.0))
    assert blind["thrust_counts"] == round(BLIND_SHARE * 40000)
    np.testing.assert_allclose(blind["attitude_rad"], 0.0)


class LoggedToy(Toy):
    """A toy with an IMU that shows it level and an estimate that is wrong from ``wrong_s`` on. An attitude makes it
    sink slowly."""

    wrong_s = np.inf

    def _step(self, dt: float) -> None:
        super()._step(dt)
        wrong = self.time_s >= self.wrong_s
        values, _ = logged(0.0, place=self.place + ([3.0, 0.0, 0.0] if wrong else 0.0), speed=(0.0, 0.0, 0.0))
        self.values.update(values)
        self.logged_s.update(dict.fromkeys(values, self.time_s))

    def send_setpoint(self, packet: bytes) -> None:
        super().send_setpoint(packet)
        if setpoint_packets.decoded(packet)["kind"] == "attitude":
            self.landing, self.goal, self.most_m_s = False, np.array([*self.place[:2], -1.0]), 0.4
            self.place[2] = max(self.place[2], 0.0)


@pytest.mark.parametrize("wrong", [True, False])
def test_the_flight_ends_by_attitude_only_if_the_estimate_is_wrong(wrong):
    toy, notes = LoggedToy(), Notes()
    toy.most_m_s = 0.45  # less than a change of velocity that the accelerometer would have to show
    ready = toy.ready(speed_m_s=0.2)
    toy.at.append((toy.time_s + 5.0, lambda: setattr(toy, "blind", True)))
    toy.at.append((toy.time_s + 4.9, lambda: setattr(toy, "most_m_s", 0.25)))  # nor a landing, to an IMU at rest
    toy.wrong_s = toy.time_s + 5.0 if wrong else np.inf
    outcome = Flight(toy, toy.track, pilot_for("onboard_pid", None, None), ready, Limits(), toy, (notes,)).run()
    kinds = [setpoint_packets.decoded(packet)["kind"] for packet in toy.packets]
    assert outcome.stop.rule == ("estimate" if wrong else "stale pose")
    rest = SETTLES_S / EVERY_S + 2  # after any landing without poses: the vehicle may be higher than it seems
    assert (kinds.count("attitude") > rest) == wrong
    assert any("taken down by attitude and thrust" in said for said in notes.said) == wrong
    assert kinds[-1] == "stop" or not wrong
    assert toy.told[-1][1] == "arm False"
    assert not (wrong and toy.motors)

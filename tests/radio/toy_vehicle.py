"""A vehicle that does at once what it is told, on a clock of its own: what rules do to a flight, in milliseconds."""

from collections import deque

import numpy as np

from nanobench_tools.radio.fly import setpoint_packets
from nanobench_tools.radio.fly.flight_plan import Plan, chosen_path
from nanobench_tools.radio.fly.flight_state import ESTIMATE, HEALTH
from nanobench_tools.radio.fly.pilot import PERIOD_S
from nanobench_tools.radio.fly.pose_tracker import PoseTrack
from nanobench_tools.radio.fly.prepare import Ready
from nanobench_tools.radio.mocap.pose_datagram import Pose

LEVEL = np.array([0.0, 0.0, 0.0, 1.0])


class Toy:
    """Link, clock and motion capture of one vehicle; ``told``: (time, what) of every command. Faults are attributes:
    ``blind`` no poses, ``mute`` no packets, ``unlogged`` no log, ``quaternion`` that poses show, ``drift_m_s`` of the
    place, ``astray_m`` of where it believes to be; and values."""

    uri, real = "toy://1", False

    def __init__(self) -> None:
        self.time_s = 100.0
        self.place, self.goal = np.zeros(3), np.zeros(3)
        self.most_m_s, self.drift_m_s = 1.5, np.zeros(3)
        self.motors = self.landing = False
        self.told: list[tuple[float, str]] = []
        self.lost, self.heard_s, self.mute, self.blind = "", self.time_s, False, False
        self.deaf, self.alarm, self.planner_answers, self.log_late_s = False, "", {}, 0.0
        self.unlogged, self.astray_m = False, np.zeros(3)
        self.round_trips_s: deque[float] = deque([0.002] * 10, maxlen=50)
        self.values = {"pm.vbat": 3.9, "supervisor.info": 0b1011}
        self.logged_s: dict[str, float] = {}
        self.quaternion = LEVEL
        self.track = PoseTrack()
        self.packets: list[bytes] = []
        self.at: list[tuple[float, object]] = []

    @property
    def echoed_s(self) -> float:
        return self.time_s

    # clock
    def now(self) -> float:
        return self.time_s

    def sleep_until(self, time_s: float) -> None:
        while self.time_s < time_s - 1e-6:
            self._step(min(PERIOD_S, time_s - self.time_s))

    def _step(self, dt: float) -> None:
        self.time_s += dt
        for when, do in list(self.at):
            if self.time_s >= when:
                self.at.remove((when, do))
                do()
        way = self.goal - self.place
        if self.motors:
            reach = self.most_m_s * dt
            far = float(np.linalg.norm(way))
            self.place = self.place + (way if far <= reach else way * reach / far) + self.drift_m_s * dt
        self.place[2] = max(self.place[2], 0.0)
        if self.landing and self.place[2] <= max(self.goal[2], 0.0) + 1e-6:
            self.motors = False  # its planner does that
        if not self.mute:
            self.heard_s = self.time_s
        if not (self.mute or self.unlogged):
            own = zip(ESTIMATE, (self.place + self.astray_m).tolist(), strict=True)
            self.values.update(own)
            self.logged_s.update(dict.fromkeys((*HEALTH, *ESTIMATE), self.time_s))
        if not self.blind:
            self.track.add(Pose(self.time_s, self.place.copy(), self.quaternion))

    # link
    def _tell(self, what: str) -> None:
        self.told.append((self.time_s, what))

    def send_setpoint(self, packet: bytes) -> None:
        said = setpoint_packets.decoded(packet)
        self.packets.append(packet)
        if said["kind"] == "position":
            self.landing = False
            self.goal = np.array(said["position_m"])
        elif said["kind"] == "stop":
            self._tell("stop")
            self.motors = False

    def release(self) -> None:
        pass

    def send_pose(self, position_m, quaternion) -> None:
        pass

    def arm(self, on: bool) -> None:
        self._tell(f"arm {on}")

    def take_off(self, height_m: float, duration_s: float) -> None:
        self._tell("take-off")
        self.motors = True
        self.goal = np.array([self.place[0], self.place[1], height_m])

    def land(self, height_m: float, duration_s: float) -> None:
        self._tell("land")
        self.landing = True
        self.goal = np.array([self.place[0], self.place[1], height_m])

    def stop_planner(self) -> None:
        self._tell("stop planner")
        self.motors = False

    def emergency_stop(self) -> None:
        self._tell("emergency stop")
        if not self.deaf:
            self.motors = False
            self.values["supervisor.info"] = 1 << 6

    def set_parameter(self, name: str, value: float) -> None:
        self._tell(f"{name} = {value}")

    def request_echo(self) -> None:
        pass

    def ready(self, seconds: float = 6.0, speed_m_s: float = 0.5) -> Ready:
        """What preparing a flight of a figure of eight gives."""
        spec = chosen_path("figure_eight", speed_m_s, 0.8, seconds)
        return Ready(Pose(self.time_s, self.place.copy(), LEVEL), Plan(spec, self.place.copy(), 0.0), 0.001, 0.0)


class Notes:
    """What a flight says of itself, kept."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def tick(self, *what: object) -> None:
        pass

    def note(self, text: str) -> None:
        self.said.append(text)

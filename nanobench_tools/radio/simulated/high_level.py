"""The high-level commander (crtp_commander_high_level.c, planner.c): take-off, landing, go-to, stored paths."""

import math
import struct
from collections.abc import Callable
from enum import IntEnum

import numpy as np

from ...firmware.records import ABSOLUTE, SETPOINT, Record
from ..crtp import Packet, Port
from .mem import TRAJECTORY_BYTES
from .polynomial import Path, Point, at_rest

EVERY_MS = 10
(SET_GROUP, TAKEOFF, LAND, STOP, GO_TO, START, DEFINE, TAKEOFF_2, LAND_2, TAKEOFF_VELOCITY, LAND_VELOCITY, SPIRAL,
 GO_TO_2, START_2) = range(14)
ENOEXEC, EBUSY, REFUSED = 8, 16, 1
DEFINITIONS = 10
DEFAULT_SPEED_M_S = 0.5
_PIECE_BYTES = 132
_LONGEST_S = 3600.0


class Plan(IntEnum):
    """What the planner does."""

    IDLE = 0
    FLYING = 1
    LANDING = 3
    DISABLED = 4


class HighLevel:
    """``memory``: where stored trajectories are. ``last`` is where the path is or, when idle, where the vehicle is."""

    def __init__(self, memory: bytearray) -> None:
        self._memory, self.plan, self.group = memory, Plan.IDLE, 0
        self.blocked, self.enabled = False, 0  # the second says nothing any more, but clients set it
        self.last = at_rest(np.zeros(3), 0.0)
        self._path: Path | None = None
        self._begin_ms = 0
        self._defined: dict[int, tuple[int, int]] = {}

    def stop(self) -> None:
        """The planner forgets what it was doing."""
        self.plan, self._path = Plan.IDLE, None

    def tell(self, position_m: np.ndarray, velocity_m_s: np.ndarray, yaw_rad: float) -> None:
        """Where the vehicle is."""
        self.last = Point(np.array(position_m, float), float(yaw_rad), np.array(velocity_m_s, float), np.zeros(3),
                          np.zeros(3), 0.0)

    @property
    def status(self) -> tuple[bool, bool, bool]:
        """Active, finished, disabled, for ``supervisor.info``."""
        return (self.plan in (Plan.FLYING, Plan.LANDING), self.finished, self.plan == Plan.DISABLED)

    @property
    def finished(self) -> bool:
        """Whether there is no path, or it has been flown to its end."""
        return self._path is None or self._elapsed_s >= self._path.duration_s

    _elapsed_s = 0.0

    def update(self, now_ms: int, estimate: Record) -> np.ndarray | None:
        """Every 10 ms: the set-point (1,), None while disabled. Without a plan it is the null set-point."""
        made = np.zeros(1, SETPOINT)
        if self._path is not None:
            self._elapsed_s = (now_ms - self._begin_ms) / 1000.0
            if self.plan == Plan.LANDING and self.finished:
                self.stop()
        if self._path is None:
            self.tell(estimate["position_m"], estimate["velocity_m_s"], math.radians(estimate["attitude_deg"][2]))
            return made if self.plan == Plan.IDLE else None
        point = self.last = self._path.at(self._elapsed_s)
        s = made[0]
        s["mode_x"] = s["mode_y"] = s["mode_z"] = s["mode_yaw"] = ABSOLUTE
        s["position_m"], s["velocity_m_s"] = point.position_m, point.velocity_m_s
        s["acceleration_m_s2"], s["jerk_m_s3"] = point.acceleration_m_s2, point.jerk_m_s3
        s["attitude_deg"][2], s["rate_deg_s"] = math.degrees(point.yaw_rad), np.degrees(point.rates_rad_s())
        return made

    def answer(self, packet: Packet, now_ms: int) -> list[Packet]:
        """The packet back, with the error in its fourth byte."""
        data = packet.data
        if not data:
            return []
        error = self._command(data[0], data[1:], now_ms)
        return [Packet(Port.HIGH_LEVEL, packet.channel, (data + bytes(3))[:3] + bytes([error]))]

    def _command(self, command: int, data: bytes, now_ms: int) -> int:
        known: dict[int, tuple[str, Callable[..., int]]] = {
            SET_GROUP: ("<B", self._set_group), STOP: ("<B", self._stop),
            TAKEOFF: ("<Bff", self._takeoff_old), LAND: ("<Bff", self._land_old),
            TAKEOFF_2: ("<Bff?f", self._takeoff), LAND_2: ("<Bff?f", self._land),
            TAKEOFF_VELOCITY: ("<Bf?f?f", self._takeoff_speed), LAND_VELOCITY: ("<Bf?f?f", self._land_speed),
            GO_TO: ("<B?fffff", self._go_to), GO_TO_2: ("<B??fffff", self._go_to_linear),
            START: ("<B??Bf", self._start_old), START_2: ("<B???Bf", self._start), DEFINE: ("<BBBIB", self._define),
        }
        if command not in known or len(data) < struct.calcsize(known[command][0]):
            return ENOEXEC
        form, act = known[command]
        given = struct.unpack_from(form, data)
        if not all(math.isfinite(v) for v in given):
            return ENOEXEC
        if command not in (SET_GROUP, DEFINE) and given[0] and not given[0] & self.group:
            return 0
        if command not in (SET_GROUP, DEFINE, STOP) and self.blocked:
            return EBUSY
        self._now_ms = now_ms
        return act(*given)

    def _set_group(self, group: int) -> int:
        self.group = group
        return 0

    def _stop(self, group: int) -> int:
        self.stop()
        return 0

    def _fly(self, path: Path, plan: Plan) -> int:
        self._path, self.plan, self._begin_ms, self._elapsed_s = path, plan, self._now_ms, 0.0
        return 0

    def _vertical(self, height_m: float, yaw_rad: float, keep_yaw: bool, duration_s: float, plan: Plan) -> int:
        """Straight up or down from ``last``, taken to be at rest."""
        start = at_rest(self.last.position_m, self.last.yaw_rad)
        goal = np.array([*self.last.position_m[:2], height_m])
        end = at_rest(goal, self.last.yaw_rad if keep_yaw else yaw_rad)
        return self._fly(Path.between(start, end, _duration(duration_s)), plan)

    def _takeoff(self, group: int, height_m: float, yaw_rad: float, keep_yaw: bool, duration_s: float) -> int:
        if self.plan != Plan.IDLE:
            return REFUSED
        return self._vertical(height_m, yaw_rad, keep_yaw, duration_s, Plan.FLYING)

    def _land(self, group: int, height_m: float, yaw_rad: float, keep_yaw: bool, duration_s: float) -> int:
        if self.plan == Plan.LANDING:
            return REFUSED
        return self._vertical(height_m, yaw_rad, keep_yaw, duration_s, Plan.LANDING)

    def _takeoff_old(self, group: int, height_m: float, duration_s: float) -> int:
        return self._takeoff(group, height_m, 0.0, False, duration_s)

    def _land_old(self, group: int, height_m: float, duration_s: float) -> int:
        return self._land(group, height_m, 0.0, False, duration_s)

    def _takeoff_speed(self, group: int, height_m: float, relative: bool, yaw_rad: float, keep_yaw: bool,
                       speed_m_s: float) -> int:
        here = self.last.position_m[2]
        height_m = here + height_m if relative else height_m
        speed = speed_m_s if speed_m_s > 0.0 else DEFAULT_SPEED_M_S
        return self._takeoff(group, height_m, yaw_rad, keep_yaw, abs(height_m - here) / speed)

    def _land_speed(self, group: int, height_m: float, relative: bool, yaw_rad: float, keep_yaw: bool,
                    speed_m_s: float) -> int:
        here = self.last.position_m[2]
        height_m = here - height_m if relative else height_m
        speed = speed_m_s if speed_m_s > 0.0 else DEFAULT_SPEED_M_S
        return self._land(group, height_m, yaw_rad, keep_yaw, abs(height_m - here) / speed)

    def _go_to(self, group: int, relative: bool, x: float, y: float, z: float, yaw_rad: float,
               duration_s: float) -> int:
        start, goal = self.last, np.array([x, y, z])
        if relative:
            goal, yaw_rad = goal + start.position_m, yaw_rad + start.yaw_rad
        return self._fly(Path.between(start, at_rest(goal, yaw_rad), _duration(duration_s)), Plan.FLYING)

    def _go_to_linear(self, group: int, relative: bool, linear: bool, x: float, y: float, z: float, yaw_rad: float,
                      duration_s: float) -> int:
        if not linear:
            return self._go_to(group, relative, x, y, z, yaw_rad, duration_s)
        start, goal = self.last, np.array([x, y, z])
        if relative:
            goal, yaw_rad = goal + start.position_m, yaw_rad + start.yaw_rad
        time_s = _duration(duration_s)
        piece = np.zeros((4, 8))
        piece[:3, 0], piece[:3, 1] = start.position_m, (goal - start.position_m) / time_s
        piece[3] = Path.between(at_rest(start.position_m, start.yaw_rad), at_rest(goal, yaw_rad), time_s).pieces[0][3]
        return self._fly(Path([piece], [time_s]), Plan.FLYING)

    def _define(self, which: int, location: int, kind: int, offset: int, pieces: int) -> int:
        """Uncompressed trajectories in the memory only; those compressed are refused."""
        if which >= DEFINITIONS or location != 1 or kind != 0 or pieces == 0:
            return ENOEXEC
        if offset + pieces * _PIECE_BYTES > TRAJECTORY_BYTES:
            return ENOEXEC
        self._defined[which] = (offset, pieces)
        return 0

    def _start_old(self, group: int, relative: bool, backwards: bool, which: int, timescale: float) -> int:
        return self._start(group, relative, False, backwards, which, timescale)

    def _start(self, group: int, relative: bool, relative_yaw: bool, backwards: bool, which: int,
               timescale: float) -> int:
        if which not in self._defined or not 0.01 <= timescale <= 100.0:
            return ENOEXEC
        offset, count = self._defined[which]
        raw = np.frombuffer(bytes(self._memory[offset:offset + count * _PIECE_BYTES]), "<f4").reshape(count, 33)
        if not np.isfinite(raw).all() or (raw[:, 32] < 0.0).any() or raw[:, 32].sum() > _LONGEST_S:
            return ENOEXEC
        path = Path([row[:32].astype(float).reshape(4, 8) for row in raw], raw[:, 32].astype(float).tolist(),
                    timescale, backwards)
        first = path.at(0.0)
        if relative:
            path.shift[:3] = self.last.position_m - first.position_m
            if relative_yaw:
                path.shift[3] = math.remainder(self.last.yaw_rad - first.yaw_rad, 2.0 * math.pi)
        return self._fly(path, Plan.FLYING)


def _duration(seconds: float) -> float:
    return min(max(seconds, 1e-3), _LONGEST_S)

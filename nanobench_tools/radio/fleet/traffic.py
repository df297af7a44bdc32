"""What the flights of a fleet know of each other: places, speeds, and that one has ended."""

import threading
from dataclasses import dataclass

import numpy as np

from ..fly.flight_ending import GROUND, LANDED
from ..fly.pose_tracker import Believed
from ..fly.safety import Rule, Situation, Stop
from .separation import Separation

ON_THE_GROUND = ("", GROUND, LANDED)


@dataclass(frozen=True)
class Neighbour:
    """Another vehicle in the air: place_m, velocity_m_s (3,)."""

    name: str
    place_m: np.ndarray
    velocity_m_s: np.ndarray


class Traffic:
    """All vehicles of a fleet. Flights write from their threads."""

    def __init__(self, separation: Separation) -> None:
        self.separation = separation
        self._lock = threading.Lock()
        self._flying: dict[str, Neighbour] = {}
        self._ended: tuple[str, Stop] | None = None

    def seen(self, name: str, phase: str, believed: Believed | None) -> None:
        """A vehicle at one tick."""
        with self._lock:
            if phase in ON_THE_GROUND:
                self._flying.pop(name, None)
            elif believed is not None:
                self._flying[name] = Neighbour(name, believed.position_m, believed.velocity_m_s)

    def gone(self, name: str) -> None:
        """A flight is over, however it ended."""
        with self._lock:
            self._flying.pop(name, None)

    def end(self, name: str, stop: Stop) -> None:
        """A flight ended early. The first one is the reason for all."""
        with self._lock:
            self._ended = self._ended or (name, stop)

    def ended(self, name: str) -> str:
        """Why the others end, in words; "" while all fly, and for the one that ended."""
        with self._lock:
            if self._ended is None or self._ended[0] == name:
                return ""
            return f"{self._ended[0]} ended: {self._ended[1].rule}: {self._ended[1].reason}"

    def neighbours(self, name: str) -> list[Neighbour]:
        """The other vehicles in the air; none for a vehicle on the ground."""
        with self._lock:
            return [] if name not in self._flying else [other for other in self._flying.values() if other.name != name]


class OtherEnded:
    """One landing lands all: another flight of the fleet ended early."""

    name = "fleet"

    def __init__(self, traffic: Traffic, own: str) -> None:
        self.traffic, self.own = traffic, own

    def check(self, now: Situation) -> str:
        return self.traffic.ended(self.own)


class TooClose:
    """Another vehicle is inside the downwash cylinder, or comes too fast to brake outside it."""

    name = "separation"

    def __init__(self, traffic: Traffic, own: str) -> None:
        self.traffic, self.own = traffic, own

    def check(self, now: Situation) -> str:
        others = self.traffic.neighbours(self.own)
        if not others:
            return ""
        apart = np.array([now.position_m - other.place_m for other in others])
        closing = np.array([now.velocity_m_s - other.velocity_m_s for other in others])
        code = self.traffic.separation.why(apart, closing)
        first = int(np.argmax(code > 0))
        if not code[first]:
            return ""
        level, height = float(np.linalg.norm(apart[first, :2])), abs(float(apart[first, 2]))
        speed = float(np.linalg.norm(closing[first]))
        return (f"{others[first].name} is {level:.2f} m level and {height:.2f} m in height away, at {speed:.1f} m/s "
                "relative to it")


def rules_of(traffic: Traffic, own: str) -> tuple[Rule, ...]:
    """Rules of a flight in addition to those of a single one."""
    return TooClose(traffic, own), OtherEnded(traffic, own)

"""One vehicle's part in a fleet, as its flight knows it."""

from ..fly.company import GROUND_S
from ..fly.interrupts import Interrupts
from ..fly.pilot import PERIOD_S
from ..fly.pose_tracker import Believed
from ..fly.prepare import Ready
from ..fly.safety import Rule, Stop
from ..host_clock import Clock
from .gathering import Gathering
from .traffic import Traffic, rules_of


class Member:
    """The ``company`` of a flight. ``interrupts``: of the flight, once it has begun; ``given_up``: why it was
    abandoned. ``share``: of a tick by which its loop comes after that of the first vehicle, so that they take turns."""

    single = False

    def __init__(self, name: str, delay_s: float, traffic: Traffic, gathering: Gathering, share: float = 0.0) -> None:
        self.name, self.delay_s = name, delay_s + share * PERIOD_S
        self._traffic, self._gathering = traffic, gathering
        self.rules: tuple[Rule, ...] = rules_of(traffic, name)
        self.interrupts: Interrupts | None = None
        self.given_up: Stop | None = None

    def confirm(self, ready: Ready, clock: Clock) -> None:
        """Before arming: waits for the others and the check of all plans."""
        self._gathering.ready(self.name, ready, clock)

    def ground_s(self, clock: Clock) -> float:
        """Armed: waits for the others. Time until this vehicle takes off."""
        return self._gathering.armed(self.name, clock, GROUND_S) + self.delay_s - clock.now()

    def flies(self, interrupts: Interrupts) -> None:
        """The flight begins."""
        self.interrupts = interrupts

    def seen(self, phase: str, believed: Believed | None) -> None:
        """Every tick."""
        self._traffic.seen(self.name, phase, believed)

    def stopped(self, stop: Stop) -> None:
        """The flight ends early: so do the others."""
        self._traffic.end(self.name, stop)

    def abandons(self, stop: Stop) -> bool:
        """The program goes on for the others."""
        self.given_up = stop
        return True

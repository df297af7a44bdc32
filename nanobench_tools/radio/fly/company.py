"""What a flight has to do with others in the air. A single flight is alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from ..host_clock import Clock
from .pose_tracker import Believed
from .safety import Rule, Stop

if TYPE_CHECKING:
    from .interrupts import Interrupts

GROUND_S = 2.0
"""At rest before take-off and after landing, for what reads the recording."""


class Company(Protocol):
    """``rules``: in addition to those of a single flight. ``single``: keys and display of the terminal are for this
    flight. ``ground_s``: time to stay on the ground once armed. ``flies``: begins, and may be interrupted so.
    ``abandons``: a flight that cannot be ended; whether the program goes on without it."""

    rules: tuple[Rule, ...]
    single: bool

    def ground_s(self, clock: Clock) -> float: ...

    def flies(self, interrupts: Interrupts) -> None: ...

    def seen(self, phase: str, believed: Believed | None) -> None: ...

    def stopped(self, stop: Stop) -> None: ...

    def abandons(self, stop: Stop) -> bool: ...


class Alone:
    """No others."""

    rules: tuple[Rule, ...] = ()
    single = True

    def ground_s(self, clock: Clock) -> float:
        """The usual rest."""
        return GROUND_S

    def flies(self, interrupts: Interrupts) -> None:
        """Not of interest here."""

    def seen(self, phase: str, believed: Believed | None) -> None:
        """Not of interest here."""

    def stopped(self, stop: Stop) -> None:
        """Not of interest here."""

    def abandons(self, stop: Stop) -> bool:
        """The program ends."""
        return False


ALONE = Alone()

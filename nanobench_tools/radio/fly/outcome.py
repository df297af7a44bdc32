"""Result of a flight, and its observers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ...results.result import Result
from .flight_loop import Beat
from .flight_plan import PATH
from .pose_tracker import Believed
from .prepare import Ready
from .safety import Stop


class Listener(Protocol):
    """Observer of a flight: the recorder, the display. The loop calls ``tick`` every tick: keep it short."""

    def tick(self, time_s: float, phase: str, believed: Believed | None, commanded_m: np.ndarray | None,
             yaw_rad: float) -> None: ...

    def note(self, text: str) -> None: ...


@dataclass
class Outcome:
    """How it ended: ``stop`` None when the whole plan was flown. ``left``: in the air, to the vehicle itself, as
    somebody asked twice. phases: (name, host time of its begin)."""

    stop: Stop | None = None
    left: bool = False
    beat: Beat | None = None
    phases: list[tuple[str, float]] = field(default_factory=list)


class TrackingError:
    """A listener: distance between poses and path while the path is flown. ``rmse_m`` is nan without a path."""

    def __init__(self) -> None:
        self._squares: list[float] = []

    def tick(self, time_s: float, phase: str, believed: Believed | None, commanded_m: np.ndarray | None,
             yaw_rad: float) -> None:
        if phase == PATH and believed is not None and commanded_m is not None:
            self._squares.append(float(np.sum((believed.position_m - commanded_m) ** 2)))

    def note(self, text: str) -> None:
        """Not of interest here."""

    @property
    def rmse_m(self) -> float:
        return float(np.sqrt(np.mean(self._squares))) if self._squares else float("nan")

    @property
    def largest_m(self) -> float:
        return float(np.sqrt(max(self._squares))) if self._squares else float("nan")


@dataclass(frozen=True, repr=False)
class FlightSummary(Result):
    """Data of a flight in addition to its recording. ``stopped``: why it landed early. ``loop``: ``Beat.summary``.
    ``phases``: (name, host time of its begin)."""

    stopped: str | None
    loop: Mapping[str, float]
    link_delay_s: float
    phases: Sequence[tuple[str, float]]


def summary(outcome: Outcome, ready: Ready) -> FlightSummary:
    """Of a flight that ended."""
    return FlightSummary(str(outcome.stop) if outcome.stop else None,
                         {} if outcome.beat is None else outcome.beat.summary(), ready.delay_s, outcome.phases)

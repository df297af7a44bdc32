"""How a flight went, and who is told while it goes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from .fly_loop import Beat
from .fly_prepare import Ready
from .fly_state import Believed
from .safety import Stop


class Listener(Protocol):
    """Is told what happens: the recorder, the display. ``tick`` every tick, from the loop: keep it short."""

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


def summary(outcome: Outcome, ready: Ready) -> dict[str, Any]:
    """What is kept of a flight beside its recording."""
    beat = outcome.beat.summary() if outcome.beat is not None else {}
    return {"stopped": str(outcome.stop) if outcome.stop else None, "loop": beat,
            "link_delay_s": ready.delay_s, "phases": [[name, time_s] for name, time_s in outcome.phases]}

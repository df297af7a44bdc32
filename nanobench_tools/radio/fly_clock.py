"""Time on the host, and waiting for it: the real one, or that of a simulated world that goes as fast as it can."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """``now`` [Unix s]. ``real``: it goes on while nobody waits."""

    real: bool

    def now(self) -> float: ...

    def sleep_until(self, time_s: float) -> None: ...


class HostClock:
    """The host's own clock."""

    real = True

    def now(self) -> float:
        return time.time()

    def sleep_until(self, time_s: float) -> None:
        left = time_s - time.time()
        if left > 0.0:
            time.sleep(left)

"""Time on the host, and waiting for it: the real one, or that of a simulated world that goes as fast as it can."""

import time
from typing import Protocol


class Clock(Protocol):
    """``now`` [Unix s]. ``real``: it goes on while nobody waits."""

    real: bool

    def now(self) -> float: ...

    def sleep_until(self, time_s: float) -> None: ...


class HostClock:
    """The host's own clock: Unix time at the start of the program, and from there what a clock says that nobody sets.
    If somebody set it back during a flight, the next tick would be waited for as long as it was set back."""

    real = True
    _AHEAD_S = time.time() - time.monotonic()

    def now(self) -> float:
        return self._AHEAD_S + time.monotonic()

    def sleep_until(self, time_s: float) -> None:
        left = time_s - self.now()
        if left > 0.0:
            time.sleep(left)

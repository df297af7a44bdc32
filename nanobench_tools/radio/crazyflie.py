"""cflib's Crazyflie, such that it never keeps a flight waiting (cflib 0.1.34; GPL-3.0).

In cflib, the sender of a packet handles an error of the driver, with the lock of all senders held. It waits for the
driver's threads (for ever, if a radio was unplugged). It also waits for a thread that measures round trips and itself
waits to send. An exception while sending leaves the lock taken for good.
"""

import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from .in_time import within

CLOSE_S = 3.0
"""Closing takes up to a second over UDP, and for ever with a radio that was unplugged."""


def crazyflie(cache: Path | None, lost: Callable[[str], None]) -> Any:
    """A Crazyflie of cflib. ``lost`` is called at once with the driver's error, from any thread."""
    from cflib.crazyflie import Crazyflie

    class InTime(Crazyflie):  # type: ignore[misc]
        def __init__(self) -> None:
            self.link: Any = None
            super().__init__(rw_cache=str(cache) if cache else None)
            self._send_lock = threading.RLock()
            self._failed = False
            self.link_statistics.latency.start = lambda: None  # ours has separate echoes

        def send_packet(self, *given: Any, **named: Any) -> None:
            try:
                super().send_packet(*given, **named)
            except BaseException as error:  # also the end of the flight, in the middle of it
                with suppress(RuntimeError):  # not taken by this thread
                    self._send_lock.release()
                if not (isinstance(error, AttributeError) and self.link is None):  # it went just now
                    raise

        def _link_error_cb(self, message: str) -> None:
            if self._failed:
                return
            self._failed = True
            driver, self.link = self.link, None  # nobody waits for it any more
            lost(message)

            def end() -> None:
                if driver is not None:
                    driver.close()
                super(InTime, self)._link_error_cb(message)

            threading.Thread(target=end, name="link error", daemon=True).start()

    return InTime()


def close(vehicle: Any, motors_off: bool) -> None:
    """Closes the link, or leaves it after CLOSE_S. ``motors_off``: cflib's set-point of nothing goes before it."""

    def end() -> None:
        if not motors_off and vehicle.link is not None:
            driver, vehicle.link = vehicle.link, None
            driver.close()
        vehicle.close_link()

    within(CLOSE_S, end, "closing the link")

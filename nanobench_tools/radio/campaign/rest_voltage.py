"""Battery voltage of a vehicle at rest, once it has recovered from the last flight."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...errors import InputError
from ..fly.checklist import health_blocks
from ..fly.session import STARTS_S
from ..host_clock import Clock
from ..vehicle_link import CflibLink, open_link

SAMPLE_S, EVERY_S = 1.0, 0.1
APART_S, STEADY_V, MOST_S = 5.0, 0.01, 120.0
"""Two means so far apart in time that agree so well are the voltage at rest. A cell recovers for a minute or two."""


def rest_voltage(uri: str, clock: Clock, cache: Path | None = None, say: Callable[[str], None] = lambda text: None
                 ) -> float:
    """Opens the link, waits until the voltage is steady and returns it [V]. Raises InputError without an answer."""
    with open_link(uri, clock, cache, STARTS_S, say) as link:
        link.start_blocks(health_blocks()[:1])
        before, began = _mean(link, clock), clock.now()
        while True:
            _wait(link, clock, APART_S)
            now = _mean(link, clock)
            if abs(now - before) <= STEADY_V or clock.now() - began > MOST_S:
                return now
            say(f"battery {now:.2f} V, still recovering")
            before = now


def _mean(link: CflibLink, clock: Clock) -> float:
    volts = []
    for _ in range(round(SAMPLE_S / EVERY_S)):
        _wait(link, clock, EVERY_S)
        volts.append(float(link.values.get("pm.vbat", np.nan)))
    if not np.isfinite(volts).any():
        raise InputError(link.uri, "the battery voltage does not come", "is the link good enough?")
    return float(np.nanmean(volts))


def _wait(link: CflibLink, clock: Clock, seconds: float) -> None:
    """A vehicle that hears nothing for a second stops its log."""
    until = clock.now() + seconds
    while clock.now() < until:
        link.request_echo()
        clock.sleep_until(min(clock.now() + EVERY_S, until))

"""Waiting for the served vehicle instead of for the machine: what a busy machine makes late is waited for."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

from cflib.crazyflie import Crazyflie
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie

from nanobench_tools.radio.simulated import server
from nanobench_tools.radio.simulated.server import SimulatedCrazyflie

ANSWER_S = 120.0
"""For an answer on a very busy machine."""


def until(done: Callable[[], Any]) -> bool:
    """True as soon as it holds, False if it does not come to that."""
    end = time.monotonic() + ANSWER_S
    while not done():
        if time.monotonic() > end:
            return False
        time.sleep(0.005)
    return True


class WorldTime:
    """Stands in for ``time`` in a module of cflib that moves a vehicle: seconds of the vehicle's world."""

    def __init__(self, served: SimulatedCrazyflie) -> None:
        self.served = served

    def time(self) -> float:
        return self.served.simulation.time_s

    def sleep(self, seconds: float) -> None:
        end = self.time() + seconds
        assert until(lambda: self.time() >= end)


@contextmanager
def linked_to(served: SimulatedCrazyflie, **how: Any) -> Iterator[SyncCrazyflie]:
    """cflib's link to the vehicle, its parameters known, once the last client has gone. This one has not gone when a
    busy machine keeps it silent."""
    assert until(lambda: served._client is None)
    link = SyncCrazyflie(served.uri, cf=Crazyflie(**{"rw_cache": None, **how}))
    with mock.patch.object(server, "SILENCE_S", ANSWER_S), link:
        link.wait_for_params()
        yield link

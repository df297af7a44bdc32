"""The clock of a simulated vehicle waits for the threads of its own link alone, and never for ever."""

import queue
import threading
import time
from types import SimpleNamespace

import pytest

from controllers.plants.served_vehicle import served
from nanobench_tools.radio.fly import virtual
from nanobench_tools.radio.fly.virtual import VirtualWorld


class Fetcher(threading.Thread):
    """A thread of cflib that has a request to send and never does; one stays behind if a link is closed while types of
    parameters are fetched."""

    _req_param = -1

    def __init__(self, crazyflie: object) -> None:
        super().__init__(daemon=True)
        self._cf, self.request_queue, self.ended = crazyflie, queue.Queue(), threading.Event()
        self.request_queue.put(b"type?")
        self.start()

    def run(self) -> None:
        self.ended.wait()


@pytest.fixture
def fetcher():
    made = Fetcher(object())
    yield made
    made.ended.set()
    made.join()


@pytest.fixture
def world(monkeypatch):
    slept = []
    monkeypatch.setattr(virtual, "time", SimpleNamespace(monotonic=time.monotonic, sleep=slept.append))
    monkeypatch.setattr(virtual, "SETTLE_S", 0.0)
    made = VirtualWorld(served())
    made.slept = slept
    return made


def test_threads_of_an_earlier_link_are_not_waited_for(world, fetcher, monkeypatch):
    monkeypatch.setattr(virtual, "SETTLE_S", 1e9)
    world.crazyflie = object()
    world._settle()
    assert world.slept == []


def test_a_thread_of_this_link_is_waited_for_once(world, fetcher, monkeypatch):
    world.crazyflie = fetcher._cf
    world._settle()
    monkeypatch.setattr(virtual, "SETTLE_S", 1e9)
    world._settle()  # nothing has changed since
    assert len(world.slept) <= 1


def test_a_thread_that_sends_ends_the_wait(world, fetcher, monkeypatch):
    monkeypatch.setattr(virtual, "SETTLE_S", 1e9)
    monkeypatch.setattr(virtual.time, "sleep", lambda seconds: world._sent(fetcher))
    world.crazyflie = fetcher._cf
    world._settle()
    assert world._waiting_for[fetcher][0] == 1

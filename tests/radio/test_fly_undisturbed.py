"""What a flight asks of the machine while it flies, and what the terminal shows of it."""

import gc
import io
import os
import sys
import threading
import time
from collections import deque
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from nanobench_tools.radio.fly.flight_loop import Beat, ahead_of_others, undisturbed
from nanobench_tools.radio.fly.pose_tracker import Believed
from nanobench_tools.radio.fly.watch import Watch

linux = pytest.mark.skipif(not hasattr(os, "sched_setscheduler"), reason="NO REAL-TIME PRIORITIES on this system")


@linux
def test_all_threads_come_before_other_processes_where_that_is_allowed_and_as_they_were_after():
    ordinary, done = os.sched_getscheduler(0), threading.Event()
    other = threading.Thread(target=done.wait)
    other.start()
    try:
        with undisturbed(), ahead_of_others():
            now = {os.sched_getscheduler(number) & ~os.SCHED_RESET_ON_FORK for number in (0, other.native_id)}
            assert now <= {os.SCHED_RR, ordinary}
            assert not gc.isenabled()
        assert {os.sched_getscheduler(number) for number in (0, other.native_id)} == {ordinary}
        assert gc.isenabled()
        with undisturbed():  # what a world of its own clock has: it leaves the machine to others
            assert os.sched_getscheduler(0) == ordinary
    finally:
        done.set()
        other.join()


@linux
def test_without_the_right_to_it_a_flight_goes_on_as_it_is(monkeypatch):
    def refused(*_):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refused)
    with undisturbed(), ahead_of_others():
        assert sys.getswitchinterval() < 0.001


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_the_terminal_shows_error_battery_link_and_loop_while_it_flies(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    link = SimpleNamespace(values={"pm.vbat": 3.71}, round_trips_s=deque([0.020, 0.022]), heard_s=time.time())
    beat = Beat(0.01, ticks=300, missed=2, late_s=[0.0004] * 300, call_s=[0.0011] * 300)
    place = Believed(0.0, np.array([0.03, 0.04, 1.0]), np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3), 0.0)
    with Watch(link, lambda: beat) as watch:
        watch.tick(2.5, "path", place, np.array([0.0, 0.0, 1.0]), 0.0)
        until = time.monotonic() + 60.0  # a busy machine is slow, not wrong
        while "missed" not in terminal.getvalue() and time.monotonic() < until:
            time.sleep(0.01)
    console = Console(file=io.StringIO(), width=100)
    console.print(watch.render())
    for text in (terminal.getvalue(), console.file.getvalue()):
        for words in ("path, 2.5 s", "5.0 cm", "3.71 V", "round trip 21.0 ms", "controller 1.10 ms", "2 of 300 missed"):
            assert words in text, words

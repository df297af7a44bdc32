"""A flight always ends: whatever hangs, fails or is asked twice, within a stated time and with a reason."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from toy_vehicle import Notes, Toy

from nanobench_tools.errors import InputError
from nanobench_tools.radio import host_clock, packets
from nanobench_tools.radio.fly import flight_plan, landing_profile, mission, safety_handover, session
from nanobench_tools.radio.fly.guardian import Guardian
from nanobench_tools.radio.fly.mission import Flight
from nanobench_tools.radio.fly.outcome import Outcome
from nanobench_tools.radio.fly.pilot import OnboardPilot
from nanobench_tools.radio.fly.safety import Limits, Stop
from nanobench_tools.radio.host_clock import HostClock
from nanobench_tools.radio.in_time import within
from nanobench_tools.radio.packets import PacketWriter

HERE = Path(__file__).parent
IN_PATH = 109.0
WIDE = Limits((-999.0, 999.0) * 3, speed_m_s=50.0, stale_s=60.0, silent_s=60.0, late_ticks=10**6)
"""Of a flight that does not end because this machine has other things to do."""


class Real(Toy):
    """The toy on the host's clock: what hangs, hangs."""

    real = True

    def __init__(self) -> None:
        super().__init__()
        self.clock = HostClock()
        self.time_s = self.heard_s = self.clock.now()
        self.most_m_s = 30.0

    def sleep_until(self, time_s: float) -> None:
        self.clock.sleep_until(time_s)
        super().sleep_until(time_s)

    def now(self) -> float:
        self.time_s = max(self.time_s, self.clock.now())
        return self.time_s


class Hangs(OnboardPilot):
    """Calls ``what`` once it is in the air, half a second after its first call."""

    def __init__(self, what) -> None:
        super().__init__("mine", 1)
        self.begun, self.what = 0.0, what

    def packet(self, time_s, state, reference):
        self.begun = self.begun or time.monotonic()
        if time.monotonic() - self.begun > 0.5:
            self.what()
        return super().packet(time_s, state, reference)


def quick(patch) -> None:
    """Take-off and landing of tenths of a second; a guardian that has patience with a busy machine."""
    patch.setattr(Guardian, "BACK_S", 60.0)
    patch.setattr(Guardian, "ALONE_S", 600.0)
    for name in ("HOLD_S", "BRIEF_HOLD_S", "SHORTEST_LANDING_S", "AFTER_S"):
        patch.setattr(safety_handover, name, 0.2)
    patch.setattr(safety_handover, "LANDING_M_S", 10.0)
    for name, value in (("LANDING_M_S", 10.0), ("SHORTEST_LANDING_S", 0.2), ("SETTLES_S", 0.0)):
        patch.setattr(landing_profile, name, value)
    for name in ("TAKEOFF_S", "SETTLE_S"):
        patch.setattr(flight_plan, name, 0.2)


def test_a_clock_that_is_set_back_keeps_nobody_waiting(monkeypatch):
    """By ten minutes, which nothing waits for."""
    clock, begun = HostClock(), time.monotonic()
    due = clock.now() + 0.01
    unix = time.time
    monkeypatch.setattr(host_clock.time, "time", lambda: unix() - 600.0)
    clock.sleep_until(due)
    assert 0.0 < clock.now() - due < 300.0
    assert time.monotonic() - begun < 300.0
    assert clock.now() == pytest.approx(unix(), abs=300.0)


def wait_for_ever() -> None:
    threading.Event().wait()


def work_for_ever() -> None:
    while True:
        time.sleep(0.001)


@pytest.mark.parametrize("hang", [wait_for_ever, work_for_ever])
def test_a_hanging_controller_is_taken_the_flight_from_and_woken(hang, monkeypatch):
    quick(monkeypatch)
    toy = Real()
    outcome = Flight(toy, toy.track, Hangs(hang), toy.ready(), WIDE, toy, ()).run()
    assert (outcome.stop.rule, outcome.stop.reason) == ("overrun", "mine did not answer within 250 ms")
    assert "land" in [w for _, w in toy.told]
    assert signal.getsignal(signal.SIGALRM) is signal.SIG_DFL
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_a_flight_that_stands_still_in_its_link_is_ended(monkeypatch):
    """No limit of time ends it before: a busy machine may take as long as it wants."""
    quick(monkeypatch)
    monkeypatch.setattr(mission, "HANG_S", 600.0)
    monkeypatch.setattr(Guardian, "STUCK_S", 600.0)
    toy, sent = Real(), []

    def send(packet: bytes) -> None:
        sent.append(packet)
        if len(sent) == 30:
            monkeypatch.setattr(Guardian, "STUCK_S", 0.1)
            wait_for_ever()

    toy.send_setpoint = send
    outcome = Flight(toy, toy.track, OnboardPilot("mine", 1), toy.ready(), WIDE, toy, ()).run()
    assert outcome.stop.rule == "overrun"
    assert "stood still" in outcome.stop.reason
    assert "land" in [w for _, w in toy.told]


ALONE = """
import ctypes, sys, time
sys.path.insert(0, {here!r})
from test_fly_ends import WIDE, Flight, Guardian, Hangs, Real, quick
from pytest import MonkeyPatch
quick(MonkeyPatch())
Guardian.BACK_S, Guardian.ALONE_S = 0.5, 3.0
def deaf():
    while True:
        try:
            time.sleep(1.0)
        except BaseException:
            pass
def hold_the_interpreter():
    ctypes.PyDLL(None).sleep(100)
toy = Real()
Flight(toy, toy.track, Hangs({what}), toy.ready(), WIDE, toy, ()).run()
"""


@pytest.mark.skipif(not hasattr(os, "sched_setscheduler"), reason="NO REAL-TIME PRIORITIES on this system")
def test_no_thread_of_a_flight_stays_behind_while_others_come_before_other_processes(monkeypatch):
    """One that holds the interpreter and has to wait for another process would keep the loop waiting, too."""
    quick(monkeypatch)
    toy, seen = Real(), []

    def look() -> None:
        if not seen:
            seen.extend((thread.name, os.sched_getscheduler(thread.native_id) & ~os.SCHED_RESET_ON_FORK)
                        for thread in threading.enumerate() if thread.native_id)
        os.kill(os.getpid(), signal.SIGINT)

    Flight(toy, toy.track, Hangs(look), toy.ready(), WIDE, toy, ()).run()
    assert "guardian" in dict(seen)
    assert len({policy for _, policy in seen}) == 1, seen


@pytest.mark.parametrize(("what", "code", "words"), [
    ("deaf", 1, "mine did not answer within 250 ms and cannot be stopped: the program ends"),
    ("hold_the_interpreter", -signal.SIGALRM, "hold_the_interpreter")])
@pytest.mark.slow
def test_a_program_that_cannot_be_woken_is_ended_and_says_where_it_was(what, code, words):
    done = subprocess.run([sys.executable, "-c", ALONE.format(here=str(HERE), what=what)], cwd=HERE.parents[1],
                          capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, words in done.stderr) == (code, True), done.stderr


@pytest.mark.slow
def test_asked_twice_it_is_told_to_land_and_nothing_is_waited_for():
    toy, notes = Toy(), Notes()

    def twice() -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        os.kill(os.getpid(), signal.SIGINT)

    toy.at.append((IN_PATH, twice))
    before = signal.getsignal(signal.SIGTERM)
    outcome = Flight(toy, toy.track, OnboardPilot("pid", 1), toy.ready(), Limits(), toy, (notes,)).run()
    assert outcome.left
    assert outcome.stop.rule == "interrupted"
    assert "twice" in outcome.stop.reason
    assert any("twice" in said for said in notes.said)
    assert [w for _, w in toy.told][-1] == "land"
    assert toy.time_s < IN_PATH + 0.02
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_second_signal_ends_a_wait_of_any_kind():
    """The loop is stuck and only signals are left: no guardian on a clock of its own."""
    toy = Toy()
    ours = threading.get_ident()

    def stuck(packet: bytes) -> None:
        for after, which in ((0.1, signal.SIGTERM), (0.2, signal.SIGINT)):  # two of a kind could become one
            threading.Timer(after, signal.pthread_kill, (ours, which)).start()
        wait_for_ever()

    toy.send_setpoint = stuck
    outcome = Flight(toy, toy.track, OnboardPilot("pid", 1), toy.ready(), Limits(), toy, ()).run()
    assert (outcome.left, outcome.stop.rule) == (True, "interrupted")


@pytest.mark.slow
def test_who_is_told_of_set_points_may_raise():
    toy, notes, told = Toy(), Notes(), []

    def listening(time_s: float, packet: bytes) -> None:
        told.append(packet)
        raise ValueError("no idea")

    flight = Flight(toy, toy.track, OnboardPilot("pid", 1), toy.ready(), Limits(), toy, (notes,), listening)
    assert flight.run().stop is None
    assert len(told) == 1
    assert any("raised ValueError: no idea" in said for said in notes.said)


@pytest.mark.slow
def test_a_bug_of_this_program_is_raised_after_the_landing():
    toy = Toy()

    class Breaks(Notes):
        def tick(self, time_s, phase, *what) -> None:
            if phase == "path":
                raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        Flight(toy, toy.track, OnboardPilot("pid", 1), toy.ready(), Limits(), toy, (Breaks(),)).run()
    assert "land" in [w for _, w in toy.told]
    assert toy.place[2] < 0.05


def test_calls_are_given_up_after_their_time():
    assert within(60.0, lambda: None, "quick")
    assert not within(0.05, wait_for_ever, "hangs")
    with pytest.raises(ZeroDivisionError):
        within(60.0, lambda: 1 // 0, "raises")


def test_a_disk_that_does_not_answer_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(packets, "CLOSE_S", 0.1)
    writer = PacketWriter(tmp_path / "a.packets", {})
    monkeypatch.setattr(writer, "_put", lambda data: wait_for_ever())
    writer.note(0.0, "never written")
    with pytest.raises(InputError, match="not answered for 0 s"):
        writer.close()


class Driver:
    """Of a radio that was unplugged: ``send`` decides what a packet does, closing never ends."""

    needs_resending = False

    def __init__(self, send) -> None:
        self.send_packet = send

    def close(self) -> None:
        wait_for_ever()


def ping():
    from cflib.crtp.crtpstack import CRTPPacket

    return CRTPPacket(0xF0, bytes(1))


def test_a_driver_that_fails_keeps_no_sender_and_no_end_waiting(monkeypatch):
    from cflib.crazyflie import State

    from nanobench_tools.radio import crazyflie

    monkeypatch.setattr(crazyflie, "CLOSE_S", 0.3)
    lost: list[str] = []
    vehicle = crazyflie.crazyflie(None, lost.append)
    vehicle.state = State.CONNECTED
    vehicle.link = Driver(lambda packet: vehicle._link_error_cb("unplugged"))
    vehicle.send_packet(ping())
    vehicle.send_packet(ping())
    assert lost == ["unplugged"]
    crazyflie.close(vehicle, motors_off=True)  # and it ends


def test_an_end_in_the_middle_of_sending_leaves_the_way_free_for_others():
    from nanobench_tools.radio.crazyflie import crazyflie

    def interrupted(packet) -> None:
        raise KeyboardInterrupt

    vehicle, sent = crazyflie(None, lambda why: None), []
    vehicle.link = Driver(interrupted)
    with pytest.raises(KeyboardInterrupt):
        vehicle.send_packet(ping())
    vehicle.link = Driver(sent.append)
    assert within(60.0, lambda: vehicle.send_packet(ping()), "another sender")
    assert len(sent) == 1


def test_a_recording_too_short_to_export_does_not_hide_why_the_flight_was_stopped(monkeypatch):
    def refused(raw, folder):
        raise InputError("a.packets", "0 poses while the log ran", "nothing to export")

    monkeypatch.setattr(session, "export", refused)
    said: list[str] = []
    request = SimpleNamespace(record_to=None, say=said.append)
    stopped = Outcome(Stop("lost link", "no packet for 0.60 s", 1.0, "ground"))
    assert session._exported(Path("a.packets"), stopped, request) is None
    assert "0 poses while the log ran" in said[0]
    with pytest.raises(InputError):
        session._exported(Path("a.packets"), Outcome(), request)

"""Sockets: who is the client, who scans, who sees poses; and whatever else comes in."""

from __future__ import annotations

import socket
import struct
import time

import numpy as np
import pytest
from still_vehicle import StillVehicle

from nanobench_tools.cli.main import main
from nanobench_tools.cli.simulate_serve import address
from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.radio.crtp import Packet, pack
from nanobench_tools.radio.mocap.pose_datagram import PORT_OFFSET, unpack
from nanobench_tools.radio.simulated import server
from nanobench_tools.radio.simulated.server import SimulatedCrazyflie
from nanobench_tools.radio.simulated.supervisor import State

HELLO, VERSION = pack(Packet(15, 1, b"\0")), pack(Packet(13, 1, b"\0"))


def client(served: SimulatedCrazyflie) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.connect(("127.0.0.1", int(served.uri.rpartition(":")[2])))
    made.settimeout(2.0)
    return made


def until_silence(viewer: socket.socket):
    """Poses until none come any more."""
    while True:
        try:
            yield unpack(viewer.recv(64))
        except TimeoutError:
            return


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def served(said: list[str]):
    with SimulatedCrazyflie(StillVehicle(), report=said.append) as made:
        yield made


def test_a_client_is_answered_and_a_second_one_is_not(served: SimulatedCrazyflie, said: list[str]) -> None:
    with client(served) as first, client(served) as second:
        first.send(HELLO)
        assert first.recv(64)[1:] == b"Bitcraze Crazyflie" + bytes(12)
        second.send(VERSION)
        second.settimeout(0.2)
        with pytest.raises(TimeoutError):
            second.recv(64)
        first.send(VERSION)
        assert first.recv(64) == b"\xdd" + struct.pack("<Bi", 0, 10)
    assert [line.split(" ", 1)[1] for line in said] == ["is connected", "is not answered: the vehicle has a client"]


def test_who_asked_in_vain_is_next_when_the_client_is_silent(served: SimulatedCrazyflie, monkeypatch) -> None:
    monkeypatch.setattr(server, "SILENCE_S", 0.2)
    with client(served) as first, client(served) as second:
        first.send(HELLO)
        first.recv(64)
        second.send(HELLO)
        assert second.recv(64)[1:19] == b"Bitcraze Crazyflie"
        first.send(VERSION)
        first.settimeout(0.1)
        with pytest.raises(TimeoutError):
            first.recv(64)


def test_scanning_needs_no_connection(served: SimulatedCrazyflie, said: list[str]) -> None:
    with client(served) as one:
        one.send(b"\xff")
        assert one.recv(64) == b"\xff"
    assert said == []


def test_poses_come_to_whoever_asked_and_stop_by_themselves(served: SimulatedCrazyflie, monkeypatch) -> None:
    monkeypatch.setattr(server, "SUBSCRIPTION_S", 0.3)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as viewer:
        viewer.settimeout(0.5)
        assert served.mocap_address[1] == int(served.uri.rpartition(":")[2]) + PORT_OFFSET
        viewer.sendto(b"?", served.mocap_address)
        poses = list(until_silence(viewer))
    times = np.array([p.time_s for p in poses])
    assert 20 <= len(poses) <= 80  # a busy machine looks seldom who has had enough
    assert np.median(np.diff(times)) == pytest.approx(0.01, abs=1e-6)
    assert abs(times[-1] - time.time()) < 2.0
    assert np.mean([p.position_m for p in poses], axis=0) == pytest.approx([0.1, -0.2, 0.3], abs=5e-4)


def test_ten_thousand_random_datagrams_neither_crash_nor_wedge_it(served: SimulatedCrazyflie) -> None:
    rng = np.random.default_rng(7)
    with client(served) as one, client(served) as other:
        one.send(HELLO)
        one.recv(64)
        one.setblocking(False)
        for k in range(10_000):
            size = int(rng.integers(0, 40))
            (one if k % 2 else other).send(rng.integers(0, 256, size, dtype=np.uint8).tobytes())
            if k % 20 == 0:
                time.sleep(0.001)
        deadline, answered = time.monotonic() + 3.0, False
        while not answered and time.monotonic() < deadline:
            one.send(VERSION)
            time.sleep(0.02)
            try:
                while not answered:
                    answered = one.recv(64) == b"\xdd" + struct.pack("<Bi", 0, 10)
            except BlockingIOError:
                continue
    assert answered
    assert served.broken is None


def test_a_locked_vehicle_is_switched_on_again_for_the_next_client(served: SimulatedCrazyflie, said: list[str]) -> None:
    served.simulation.onboard.supervisor.state = State.LOCKED
    with client(served) as one:
        one.send(HELLO)
        one.recv(64)
        time.sleep(0.1)
        assert served.simulation.onboard.supervisor.state != State.LOCKED
        one.send(VERSION)
        assert one.recv(64) == b"\xdd" + struct.pack("<Bi", 0, 10)
    assert any("switched on again" in line for line in said)


def test_a_busy_machine_lets_the_world_stand_still(served: SimulatedCrazyflie) -> None:
    before = served.simulation.onboard.tick_ms
    served._zero_s += 5.0  # as if five seconds had been slept through
    time.sleep(0.2)
    assert served.stood_s == pytest.approx(5.0, abs=1.5)
    assert served.simulation.onboard.tick_ms - before < 2000


def test_a_taken_port_is_one_line(served: SimulatedCrazyflie) -> None:
    again = SimulatedCrazyflie(StillVehicle(), port=int(served.uri.rpartition(":")[2]))
    with pytest.raises(InputError, match="cannot be served"):
        again.start()


def test_the_own_clock_goes_as_fast_as_it_can() -> None:
    made = SimulatedCrazyflie(StillVehicle(), own_clock=True)
    assert made.post(HELLO)
    assert not made.post(b"\xff")
    assert [d[1:9] for d in made.advance(0.05)] == [b"Bitcraze"]
    began = time.perf_counter()
    made.advance(20.0)
    assert time.perf_counter() - began < 5.0
    assert made.simulation.onboard.tick_ms == 1000 + 20_050
    with pytest.raises(ValueError, match="real time"):
        SimulatedCrazyflie(StillVehicle()).advance(1.0)


@pytest.mark.parametrize("uri", ["radio://0/80", "udp://", "udp://127.0.0.1:x", "udp://nowhere.example:1",
                                 "udp://127.0.0.1:70000", "udp://0.0.0.0:19850", "udp://192.168.1.5:19850"])
def test_other_addresses_are_refused(uri: str) -> None:
    with pytest.raises(UsageError):
        address(uri, anywhere=False)


def test_addresses() -> None:
    assert address("udp://127.0.0.1:19850", False) == ("127.0.0.1", 19850)
    assert address("udp://localhost", False) == ("127.0.0.1", 19850)
    assert address("udp://0.0.0.0:19851", True) == ("0.0.0.0", 19851)


@pytest.mark.parametrize(("arguments", "said"), [
    ("--serve udp://0.0.0.0:19850", "--bind-anywhere"),
    ("--battery 3.9 --out x", "go with --serve"),
    ("--serve udp://127.0.0.1 --wind 1,2", "not 3 numbers"),
    ("--serve udp://127.0.0.1:19850 --loss 2", "loss 2; give 0 to 0.9"),
    ("--serve udp://127.0.0.1:19850 --battery 9", "battery: 9 V"),
    ("--serve udp://127.0.0.1:19850 --simulator nothing.toml", "nothing.toml"),
])
def test_the_verb_refuses_in_one_line(arguments: str, said: str, capsys: pytest.CaptureFixture) -> None:
    assert main(["simulate", "--quiet", *arguments.split()]) == 2
    error = capsys.readouterr().err.strip()
    assert said in error


def test_the_verb_serves_for_a_while(capsys: pytest.CaptureFixture) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1] % 40000 + 20000
    assert main(["simulate", "--serve", f"udp://127.0.0.1:{port}", "--seconds", "0.3", "--wind", "0.1,0,0",
                 "--battery", "4.0", "--start", "1,2,0.1,90", "--latency-s", "0.01", "--loss", "0.02"]) == 0
    assert f"serving udp://127.0.0.1:{port}" in capsys.readouterr().err

"""Sockets: who is the client, who scans, who sees poses; and whatever else comes in."""

import select
import socket
import struct
from contextlib import ExitStack, suppress

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

ANSWER_S = 60.0
"""A busy machine is slow, not wrong."""
HELLO, VERSION = pack(Packet(15, 1, b"\0")), pack(Packet(13, 1, b"\0"))


class ByHand:
    """Stands in for the server's clock: time passes when a test lets it pass, not while a busy machine is slow."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, said: list[str]) -> None:
        self.now_s = 1000.0
        monkeypatch.setattr(server, "time", self)
        monkeypatch.setattr(SimulatedCrazyflie, "_serve", lambda served: None)
        self.served = SimulatedCrazyflie(StillVehicle(), report=said.append)

    def monotonic(self) -> float:
        return self.now_s

    def time(self) -> float:
        return 1.7e9 + self.now_s

    def passes(self, seconds: float) -> None:
        """One turn of the server after the other, each when something is due."""
        end = self.now_s + seconds
        while self.now_s < end:
            due = self.served.simulation.next_s() - self.time()
            self.now_s = min(end, self.now_s + max(due, 0.0005))
            self.served._turn()

    def hears(self, sender: socket.socket, datagram: bytes) -> None:
        """What was sent is there before time goes on."""
        sender.send(datagram)
        assert select.select([self.served._radio_socket], [], [], ANSWER_S)[0]
        self.passes(0.1)


def client(served: SimulatedCrazyflie) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.connect(("127.0.0.1", int(served.uri.rpartition(":")[2])))
    made.settimeout(ANSWER_S)
    return made


def waiting(receiver: socket.socket) -> list[bytes]:
    """Datagrams that have come."""
    found = []
    while select.select([receiver], [], [], 0.0)[0]:
        found.append(receiver.recv(64))
    return found


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def world(said: list[str], monkeypatch: pytest.MonkeyPatch):
    made = ByHand(monkeypatch, said)
    with made.served:
        yield made


def test_a_client_is_answered_and_a_second_one_is_not(world: ByHand, said: list[str]) -> None:
    with client(world.served) as first, client(world.served) as second:
        world.hears(first, HELLO)
        assert first.recv(64)[1:] == b"Bitcraze Crazyflie" + bytes(12)
        world.hears(second, VERSION)
        world.hears(first, VERSION)
        assert first.recv(64) == b"\xdd" + struct.pack("<Bi", 0, 10)
        assert waiting(second) == []
    assert [line.split(" ", 1)[1] for line in said] == ["is connected", "is not answered: the vehicle has a client"]


def test_who_asked_in_vain_is_next_when_the_client_is_silent(world: ByHand) -> None:
    with client(world.served) as first, client(world.served) as second:
        world.hears(first, HELLO)
        first.recv(64)
        world.hears(second, HELLO)
        assert waiting(second) == []
        world.passes(server.SILENCE_S)
        assert second.recv(64)[1:19] == b"Bitcraze Crazyflie"
        world.hears(first, VERSION)
        world.hears(second, VERSION)
        second.recv(64)
        assert waiting(first) == []


@pytest.mark.parametrize(("swap", "flying", "kept"), [(True, False, False), (False, False, True), (True, True, True)])
def test_every_client_finds_a_new_battery_if_the_vehicle_does_not_fly(world: ByHand, swap, flying, kept) -> None:
    world.served._swap_battery = swap
    onboard = world.served.simulation.onboard
    before = onboard.vehicle.stabilizer
    onboard.supervisor.flying = flying
    with client(world.served) as one:
        one.send(HELLO)
        assert select.select([world.served._radio_socket], [], [], ANSWER_S)[0]
        world.served._receive(world.time())
    assert (world.served.simulation.onboard.vehicle.stabilizer is before) == kept


def test_scanning_needs_no_connection(world: ByHand, said: list[str]) -> None:
    with client(world.served) as one:
        world.hears(one, b"\xff")
        assert one.recv(64) == b"\xff"
    assert said == []


def test_poses_come_to_whoever_asked_and_stop_by_themselves(world: ByHand, monkeypatch) -> None:
    monkeypatch.setattr(server, "SUBSCRIPTION_S", 0.3)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as viewer:
        assert world.served.mocap_address[1] == int(world.served.uri.rpartition(":")[2]) + PORT_OFFSET
        viewer.sendto(b"?", world.served.mocap_address)
        assert select.select([world.served._mocap_socket], [], [], ANSWER_S)[0]
        began = world.time()
        world.passes(1.0)
        viewer.settimeout(ANSWER_S)
        poses = [unpack(viewer.recv(64)) for _ in range(29)]
        assert len(waiting(viewer)) <= 1
    times = np.array([p.time_s for p in poses])
    assert np.diff(times) == pytest.approx(0.01, abs=1e-6)
    assert times[-1] - began == pytest.approx(0.29, abs=0.02)
    assert np.mean([p.position_m for p in poses], axis=0) == pytest.approx([0.1, -0.2, 0.3], abs=5e-4)


def test_ten_thousand_random_datagrams_neither_crash_nor_wedge_it(world: ByHand) -> None:
    rng = np.random.default_rng(7)
    answer = b"\xdd" + struct.pack("<Bi", 0, 10)
    with client(world.served) as one, client(world.served) as other:
        world.hears(one, HELLO)
        for k in range(10_000):
            size = int(rng.integers(0, 40))
            (one if k % 2 else other).send(rng.integers(0, 256, size, dtype=np.uint8).tobytes())
            if k % 20 == 0:
                world.passes(0.001)
        for _ in range(30):  # what is on the air comes first
            world.hears(one, VERSION)
            if answer in waiting(one):
                return
    raise AssertionError("it does not answer any more")


def test_a_locked_vehicle_is_switched_on_again_for_the_next_client(world: ByHand, said: list[str]) -> None:
    world.served.simulation.onboard.supervisor.state = State.LOCKED
    with client(world.served) as one:
        world.hears(one, HELLO)
        one.recv(64)
        assert world.served.simulation.onboard.supervisor.state != State.LOCKED
        world.hears(one, VERSION)
        assert one.recv(64) == b"\xdd" + struct.pack("<Bi", 0, 10)
    assert any("switched on again" in line for line in said)


def test_a_busy_machine_lets_the_world_stand_still(world: ByHand) -> None:
    world.passes(0.1)
    before = world.served.simulation.onboard.tick_ms
    world.now_s += 5.0  # slept through
    world.served._turn()
    assert world.served.stood_s == pytest.approx(5.0, abs=0.01)
    assert world.served.simulation.onboard.tick_ms - before < 20
    world.passes(0.5)
    assert world.served.simulation.onboard.tick_ms - before == pytest.approx(500, abs=20)


def test_a_taken_port_is_one_line(world: ByHand) -> None:
    again = SimulatedCrazyflie(StillVehicle(), port=int(world.served.uri.rpartition(":")[2]))
    with pytest.raises(InputError, match="cannot be served"):
        again.start()


def test_the_own_clock_goes_on_when_it_is_told() -> None:
    made = SimulatedCrazyflie(StillVehicle(), own_clock=True)
    assert made.post(HELLO)
    assert not made.post(b"\xff")
    assert [d[1:9] for d in made.advance(0.05)] == [b"Bitcraze"]
    made.advance(20.0)
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


def free_port() -> int:
    """One whose port of the motion capture is free, too."""
    while True:
        with ExitStack() as stack:
            one, other = (stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(2))
            one.bind(("127.0.0.1", 0))
            port = one.getsockname()[1]
            with suppress(OSError, OverflowError):
                other.bind(("127.0.0.1", port + PORT_OFFSET))
                return port


def test_the_verb_serves_for_a_while(capsys: pytest.CaptureFixture) -> None:
    port = free_port()
    assert main(["simulate", "--serve", f"udp://127.0.0.1:{port}", "--seconds", "0.3", "--wind", "0.1,0,0",
                 "--battery", "4.0", "--start", "1,2,0.1,90", "--latency-s", "0.01", "--loss", "0.02"]) == 0
    assert f"serving udp://127.0.0.1:{port}" in capsys.readouterr().err

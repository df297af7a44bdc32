"""The simulated Crazyflie: connecting, speed with its own clock, ten at once in real time. Everything SYNTHETIC.

    python benchmarks/speed/served_vehicle.py [--seconds S] [--vehicles N]

Connecting: cflib from PyPI through UDP until all parameters are there, without a table cache. Own clock: a flight with
the nine blocks of the recordings at 100 Hz, and set-points and poses at 100 Hz. The plain version for comparison is
the same vehicle and firmware stepped without radio, logs and poses. Ten at once: ``nanobench simulate --serve
--vehicles N`` in a separate process, flown and logged like that by this one. A turn of the server (one every 10 ms or
sooner) is late if it ran more than 10 ms after its time.
"""

import argparse
import os
import re
import resource
import select
import socket
import statistics
import struct
import subprocess
import sys
import time
from collections.abc import Callable

from kept import show

from controllers.plants.served_vehicle import served
from nanobench_tools.errors import how_to_install
from nanobench_tools.radio.crtp import Packet, Port, pack, parse
from nanobench_tools.radio.mocap.pose_datagram import HELLO, unpack
from nanobench_tools.radio.simulated.server import SimulatedCrazyflie

BLOCKS = ("acc.x acc.y acc.z gyro.x gyro.y gyro.z", "motor.m1 motor.m2 motor.m3 motor.m4",
          "stateEstimate.x stateEstimate.y stateEstimate.z stateEstimate.vx stateEstimate.vy stateEstimate.vz",
          "stateEstimate.ax stateEstimate.ay stateEstimate.az",
          "stateEstimate.roll stateEstimate.pitch stateEstimate.yaw",
          "stateEstimate.qx stateEstimate.qy stateEstimate.qz stateEstimate.qw",
          "ctrltarget.x ctrltarget.y ctrltarget.z ctrltarget.yaw",
          "controller.roll controller.pitch controller.yaw controller.cmd_thrust", "pm.vbat")
"""What the recordings log, one block a line."""
FIRST_PORT = 29850
REPEATS = 5


def start_blocks(ask: Callable[[bytes], bytes]) -> None:
    """Fetches the table of log variables and starts the nine blocks."""
    names, table = {name for block in BLOCKS for name in block.split()}, {}
    count = int.from_bytes(parse(ask(pack(Packet(Port.LOG, 0, b"\3")))).data[1:3], "little")
    for i in range(count):
        group, name, _ = parse(ask(pack(Packet(Port.LOG, 0, struct.pack("<BH", 2, i))))).data[4:].split(b"\0")
        table[f"{group.decode()}.{name.decode()}"] = i
    assert names <= set(table)
    for number, block in enumerate(BLOCKS):
        kinds = [struct.pack("<BH", 2 if name.startswith("motor") else 7, table[name]) for name in block.split()]
        ask(pack(Packet(Port.LOG, 1, bytes([6, number]) + b"".join(kinds))))
        ask(pack(Packet(Port.LOG, 1, bytes([3, number, 1]))))


def setpoint(time_s: float) -> bytes:
    """Up to one metre, by the onboard PID."""
    return pack(Packet(Port.GENERIC, 0, struct.pack("<B4f", 7, 0.0, 0.0, min(0.5 * time_s, 1.0), 0.0)))


def pose(position, quaternion) -> bytes:
    return pack(Packet(Port.LOCALIZATION, 1, struct.pack("<B7f", 8, *position, *quaternion)))


def connecting() -> None:
    """Seconds from opening the link until all parameters are there."""
    try:
        import cflib.crtp
        from cflib.crazyflie import Crazyflie
        from cflib.crazyflie.syncCrazyflie import SyncCrazyflie
    except ImportError:
        print(f"connecting: cflib is not installed; {how_to_install('radio')}")
        return
    cflib.crtp.init_drivers()
    found = []
    with SimulatedCrazyflie(served()) as vehicle:
        for _ in range(REPEATS):
            began = time.monotonic()
            with SyncCrazyflie(vehicle.uri, cf=Crazyflie(rw_cache=None)) as link:
                link.wait_for_params()
                found.append(time.monotonic() - began)
    print(f"connecting with cflib, all parameters read: median {statistics.median(found):.2f} s, "
          f"longest {max(found):.2f} s (n = {len(found)}; aim: below 3 s)")


def own_clock(seconds: float) -> None:
    """How much faster than real time a fully loaded flight is."""
    body = served()
    vehicle = SimulatedCrazyflie(body, own_clock=True)

    def ask(datagram: bytes) -> bytes:
        vehicle.post(datagram)
        return vehicle.advance(0.001)[-1]

    start_blocks(ask)
    packets, begin, cpu = 0, time.perf_counter(), time.process_time()
    for tick in range(round(100 * seconds)):
        position, _, quaternion = body.true_pose()
        vehicle.post(pose(position, quaternion))
        vehicle.post(setpoint(0.01 * tick))
        packets += len(vehicle.advance(0.01))
    wall, used = time.perf_counter() - begin, time.process_time() - cpu
    print(f"own clock: {seconds:.0f} s in {wall:.2f} s, {seconds / wall:.0f} x real time ({seconds / used:.0f} x by "
          f"processor time; aim: 20 x), {packets / seconds:.0f} packets/s down, height {body.true_pose()[0][2]:.2f} m")
    alone = served()
    cpu = time.process_time()
    for _ in range(round(100 * seconds)):
        alone.advance(10)
    show("vehicle and firmware alone / served with logs, poses and set-points", (time.process_time() - cpu) / used,
         round(100 * seconds))


class Pilot:
    """One client by hand: poses in, set-points and poses out, log packets counted."""

    def __init__(self, port: int) -> None:
        self.radio, self.cameras = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.radio.connect(("127.0.0.1", port))
        self.cameras.connect(("127.0.0.1", port + 100))
        self.radio.settimeout(10.0)
        start_blocks(self._ask)
        self.radio.setblocking(False)
        self.cameras.setblocking(False)
        self.logged = self.poses = 0

    def _ask(self, datagram: bytes) -> bytes:
        self.radio.send(datagram)
        wanted = datagram[0] >> 4, datagram[0] & 3
        while True:
            answer = self.radio.recv(64)
            if (answer[0] >> 4, answer[0] & 3) == wanted:
                return answer

    def subscribe(self) -> None:
        self.cameras.send(HELLO)

    def hear(self, time_s: float) -> None:
        """Everything that waits; each pose is answered with itself and a set-point, as a lab's program does it."""
        while (datagram := _next(self.radio)) is not None:
            self.logged += datagram[0] >> 4 == Port.LOG
        while (datagram := _next(self.cameras)) is not None:
            seen = unpack(datagram)
            self.poses += 1
            self.radio.send(pose(seen.position_m, seen.quaternion))
            self.radio.send(setpoint(time_s))


def _next(through: socket.socket) -> bytes | None:
    try:
        return through.recv(64)
    except BlockingIOError:
        return None


def many(vehicles: int, seconds: float) -> None:
    """So many vehicles in one process, all flown and logged at once."""
    command = [sys.executable, "-m", "nanobench_tools.cli.main", "simulate", "--serve", f"udp://127.0.0.1:{FIRST_PORT}",
               "--vehicles", str(vehicles)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    server = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        for line in server.stderr:
            if f":{FIRST_PORT + vehicles - 1}, poses" in line:
                break
        pilots: list[Pilot] = []
        for i in range(vehicles):
            pilots.append(Pilot(FIRST_PORT + i))
            for pilot in pilots:
                pilot.subscribe()
                pilot.hear(0.0)
        for pilot in pilots:
            pilot.logged = pilot.poses = 0
        sockets = [s for p in pilots for s in (p.radio, p.cameras)]
        begin, subscribed = time.monotonic(), 0.0
        while (now := time.monotonic() - begin) < seconds:
            if now >= subscribed:
                for pilot in pilots:
                    pilot.subscribe()
                subscribed += 1.0
            select.select(sockets, [], [], 0.005)
            for pilot in pilots:
                pilot.hear(now)
    finally:
        server.send_signal(2)
        _, report = server.communicate(timeout=120)
    used = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    turns = [tuple(map(int, found)) for found in re.findall(r"(\d+) turns, (\d+) more", report)]
    stood = sum(map(float, re.findall(r"stood still for ([0-9.]+) s", report)))
    total, late = sum(t for t, _ in turns), sum(n for _, n in turns)
    rate = sum(p.logged for p in pilots) / seconds / vehicles / len(BLOCKS)
    poses = sum(p.poses for p in pilots) / seconds / vehicles
    print(f"{vehicles} vehicles in one process on {os.cpu_count()} cores, {seconds:.0f} s in real time. "
          f"{late} of {total} turns late ({100.0 * late / max(total, 1):.2f} %), {stood:.1f} s stood still in all. "
          f"Each: {rate:.1f} Hz a block, {poses:.1f} poses/s. Processor time {used:.1f} s with starting; load "
          f"{os.getloadavg()[0]:.1f}")


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--seconds", type=float, default=20.0)
    options.add_argument("--vehicles", type=int, default=10)
    given = options.parse_args()
    connecting()
    own_clock(given.seconds)
    many(1, given.seconds)
    many(given.vehicles, given.seconds)


if __name__ == "__main__":
    main()

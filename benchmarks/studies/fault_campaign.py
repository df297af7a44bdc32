"""Flights with one injected fault each: how far the vehicle gets from its plan, and from which height it drops.

``--flights N`` (default 80) flies N flights on the simulated vehicle's own clock, over a link of 10 ms that loses 1 %.
The faults take turns, as do controllers; path, speed and the moment of the fault are drawn with ``--seed``. A flight
fails if the vehicle gets more than 1.5 m outside its plan, or drops from above 0.3 m. ``--fault NAME`` flies one fault.
``--json FILE`` keeps every flight, and those that FILE has are not flown again. ``--for-s S`` stops after S seconds, so
that the campaign can be flown in pieces. All of it is SYNTHETIC.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from controllers.plants.served_vehicle import served  # noqa: E402
from nanobench_tools import so3  # noqa: E402
from nanobench_tools.cli.flights.flight_controllers import pilot_for  # noqa: E402
from nanobench_tools.radio.crtp import Port  # noqa: E402
from nanobench_tools.radio.fly.flight_plan import Plan, chosen_path  # noqa: E402
from nanobench_tools.radio.fly.safety import Limits  # noqa: E402
from nanobench_tools.radio.fly.session import Request, fly_session  # noqa: E402
from nanobench_tools.radio.fly.virtual import VirtualWorld  # noqa: E402
from nanobench_tools.radio.mocap.pose_datagram import Pose, pack, unpack  # noqa: E402
from nanobench_tools.radio.simulated.channel import RadioOptions  # noqa: E402
from nanobench_tools.radio.simulated.motion_capture import MocapOptions  # noqa: E402
from nanobench_tools.radio.simulated.packet_faults import Kind, PacketFaults, every, kind  # noqa: E402

ROOM = MocapOptions(noise_m=1.2e-5, noise_rad=6e-4)
CONTROLLERS = ("onboard_pid", "geometric", "mpc_daqp", "onboard_mellinger", "lqr", "mellinger_full")
PATHS = (("circle", 0.6), ("figure_eight", 0.8))
MOST_OUTSIDE_M, MOST_DROP_M = 1.5, 0.3
AIR_M, AFTERWARDS_S = 0.8, 3.0
FOREVER = np.inf
SETPOINTS, ENDS, POSES = kind(Port.GENERIC, 0), kind(Port.GENERIC, 1), kind(Port.LOCALIZATION, 1)
PLANNER, LOG, ECHO = kind(Port.HIGH_LEVEL), kind(Port.LOG), kind(Port.LINK)


@dataclasses.dataclass(frozen=True)
class Fault:
    """One fault.

    - ``up``, ``down``: packets of this kind. A ``share`` of them is lost, or ``late_s`` late, for ``lasts_s``.
    - ``pose``: (pose, earlier poses, s since the start) -> pose or None. ``pilot``: (packet, s since) -> packet.
    - ``step``: called every millisecond with the world and s since. ``world``: settings of the vehicle.
    """

    up: Kind | None = None
    down: Kind | None = None
    lasts_s: float = FOREVER
    share: float = 1.0
    late_s: float = 0.0
    pose: Callable[[Pose, list[Pose], float], Pose | None] | None = None
    step: Callable[[FaultWorld, float], None] | None = None
    pilot: Callable[[bytes, float], bytes] | None = None
    world: dict[str, Any] = dataclasses.field(default_factory=dict)


class FaultWorld(VirtualWorld):
    """The fault begins ``after_s`` after the vehicle rose above AIR_M; ``seen``: (t, x, y, z, motors) every 10 ms."""

    def __init__(self, fault: Fault, after_s: float, seed: int) -> None:
        super().__init__(served(seed=seed, **fault.world), RadioOptions(latency_s=0.010, loss=0.01), ROOM)
        self._fault, self._after_s, self._high_s = fault, after_s, np.inf
        self._packets = PacketFaults(lambda: self.since_s, np.random.default_rng(seed), fault.up, fault.down,
                                     fault.lasts_s, fault.share, fault.late_s)
        self._before: list[Pose] = []
        self.once: set[str] = set()
        self.seen: list[tuple[float, ...]] = []
        came, due = self.simulation.outgoing, self.simulation.mocap.due
        self.simulation.outgoing = lambda t: self._packets.arriving(t, came(t))  # type: ignore[method-assign]
        self.simulation.mocap.due = lambda t: self._poses(due(t))  # type: ignore[method-assign]

    @property
    def since_s(self) -> float:
        """Since the fault began; negative before."""
        return self.now() - self._high_s - self._after_s

    def post(self, datagram: bytes) -> None:
        self._packets.post(self.now(), datagram, super().post)

    def _poses(self, datagrams: list[bytes]) -> list[bytes]:
        found = []
        for datagram in datagrams:
            pose: Pose | None = unpack(datagram)
            true = pose
            if self._fault.pose is not None and pose is not None and 0.0 <= self.since_s < self._fault.lasts_s:
                pose = self._fault.pose(pose, self._before, self.since_s)
            elif true is not None:
                self._before = [*self._before[-100:], true]
            if pose is not None:
                found.append(pack(*pose))
        return found

    def _step(self, time_s: float) -> None:
        self._packets.release(time_s, super().post)
        super()._step(time_s)
        vehicle = self.simulation.onboard.vehicle
        place, _, _ = vehicle.true_pose()
        if place[2] > AIR_M:
            self._high_s = min(self._high_s, time_s)
        if self._fault.step is not None and 0.0 <= self.since_s < self._fault.lasts_s:
            self._fault.step(self, self.since_s)
        if self._steps % 10 == 0:
            self.seen.append((time_s, *place, float(vehicle.stabilizer.loop["motor"].max())))


# -- lies of poses

def held(pose: Pose, before: list[Pose], since_s: float) -> Pose:
    return Pose(pose.time_s, before[-1].position_m, before[-1].quaternion)


def held_with_noise(pose: Pose, before: list[Pose], since_s: float) -> Pose:
    return moved(held(pose, before, since_s), 2e-4 * np.sin(1e3 * pose.time_s * np.arange(1, 4)))


def moved(pose: Pose, by_m: np.ndarray) -> Pose:
    return pose._replace(position_m=pose.position_m + by_m)


def turned(pose: Pose, angle_rad: float, world: bool) -> Pose:
    """The world, or the body alone, is turned about z."""
    by = so3.exp(np.array([0.0, 0.0, angle_rad]))
    if not world:
        return pose._replace(quaternion=so3.multiply(pose.quaternion, by))
    return Pose(pose.time_s, so3.rotate(by, pose.position_m), so3.multiply(by, pose.quaternion))


def mirrored(axis: int) -> Callable[[Pose, list[Pose], float], Pose]:
    def lie(pose: Pose, before: list[Pose], since_s: float) -> Pose:
        place, turn = np.ones(3), -np.ones(4)
        place[axis], turn[axis], turn[3] = -1.0, 1.0, 1.0
        return Pose(pose.time_s, pose.position_m * place, pose.quaternion * turn)
    return lie


class Late:
    """Poses of ``late_s`` ago with timestamps of now."""

    def __init__(self, late_s: float) -> None:
        self.rows, self.kept = round(100 * late_s), []

    def __call__(self, pose: Pose, before: list[Pose], since_s: float) -> Pose:
        if since_s < 0.011:
            self.kept = list(before)
        self.kept = [*self.kept[-100:], pose]
        then = self.kept[-self.rows - 1]
        return Pose(pose.time_s, then.position_m, then.quaternion)


def sparse(pose: Pose, before: list[Pose], since_s: float) -> Pose | None:
    return pose if round(100 * since_s) % 5 == 0 else None


def noisy(pose: Pose, before: list[Pose], since_s: float) -> Pose:
    return moved(pose, 0.02 * np.random.default_rng(int(1e3 * pose.time_s) % 2**32).standard_normal(3))


# -- faults of the vehicle

def reset_filter(world: FaultWorld, since_s: float) -> None:
    if "reset" not in world.once:
        world.once.add("reset")
        world.simulation.onboard.vehicle.stabilizer.task["reset"] = 1


def blind_and_reset(world: FaultWorld, since_s: float) -> None:
    world.blind = True
    reset_filter(world, since_s)


def pushed(*force_N: float) -> Callable[[FaultWorld, float], None]:
    return lambda world, since_s: world.simulation.onboard.vehicle.push(force_N)  # type: ignore[attr-defined]


def gust(world: FaultWorld, since_s: float) -> None:
    on = since_s < 1.0
    world.simulation.onboard.vehicle.push((0.08 * on, 0.05 * on, 0.0))  # type: ignore[attr-defined]


def empty(world: FaultWorld, since_s: float) -> None:
    world.simulation.onboard.vehicle._world["charge"] *= 1.0 - 2e-4  # type: ignore[attr-defined]


def interrupt(world: FaultWorld, since_s: float) -> None:
    if "signal" not in world.once:
        world.once.add("signal")
        os.kill(os.getpid(), signal.SIGINT)


# -- faults of the controller

def raises(packet: bytes, since_s: float) -> bytes:
    raise RuntimeError("a bug")


def repeats() -> Callable[[bytes, float], bytes]:
    kept: list[bytes] = []

    def pilot(packet: bytes, since_s: float) -> bytes:
        kept.append(packet)
        return kept[0]
    return pilot


def lost(lasts_s: float = FOREVER, **what: Any) -> Fault:
    return Fault(lasts_s=lasts_s, **what)


def faults() -> dict[str, Fault]:
    """Name -> fault, new for every flight: some remember."""
    rng = {"share": 0.6}
    return {
        "none": Fault(),
        "set-points lost 0.3 s": lost(0.3, up=SETPOINTS), "set-points lost 1 s": lost(1.0, up=SETPOINTS),
        "set-points lost for good": lost(up=SETPOINTS),
        "poses to the vehicle lost 0.5 s": lost(0.5, up=POSES), "poses to the vehicle lost 2 s": lost(2.0, up=POSES),
        "poses to the vehicle lost for good": lost(up=POSES),
        "planner's commands lost": lost(up=PLANNER), "end of set-points lost": lost(up=ENDS),
        "log lost 1.5 s": lost(1.5, down=LOG), "log lost for good": lost(down=LOG),
        "echoes lost": lost(up=ECHO, down=ECHO),
        "link lost 0.3 s": lost(0.3, up=every, down=every), "link lost 0.8 s": lost(0.8, up=every, down=every),
        "link lost 1.6 s": lost(1.6, up=every, down=every),
        "link lost for good": lost(up=every, down=every), "all from the vehicle lost": lost(down=every),
        "all to the vehicle lost": lost(up=every),
        "60 % of packets lost": lost(up=every, down=every, **rng), "30 % lost": lost(up=every, down=every, share=0.3),
        "set-points 50 ms late": lost(up=SETPOINTS, late_s=0.05), "set-points 150 ms late": lost(up=SETPOINTS,
                                                                                             late_s=0.15),
        "poses to the vehicle 50 ms late": lost(up=POSES, late_s=0.05),
        "poses to the vehicle 150 ms late": lost(up=POSES, late_s=0.15),
        "log 200 ms late": lost(down=LOG, late_s=0.2), "all 300 ms late": lost(up=every, down=every, late_s=0.3),
        "poses end": Fault(pose=lambda pose, before, s: None),
        "poses end 0.2 s": Fault(pose=lambda pose, before, s: None, lasts_s=0.2),
        "poses end, filter reset": Fault(step=blind_and_reset), "filter reset": Fault(step=reset_filter),
        "poses frozen": Fault(pose=held), "poses frozen with noise": Fault(pose=held_with_noise),
        "poses mirrored in x": Fault(pose=mirrored(0)), "poses mirrored in y": Fault(pose=mirrored(1)),
        "poses 0.1 s late": Fault(pose=Late(0.1)), "poses 0.3 s late": Fault(pose=Late(0.3)),
        "poses of another body": Fault(pose=lambda p, b, s: moved(held_with_noise(p, b, s), np.array([0.5, 0.3, 0.0]))),
        "poses jump by 1 m": Fault(pose=lambda p, b, s: moved(p, np.array([1.0, 0.0, 0.0]))),
        "poses jump by 1 m for 50 ms": Fault(pose=lambda p, b, s: moved(p, np.array([1.0, 0.0, 0.0])), lasts_s=0.05),
        "poses drift with 0.2 m/s": Fault(pose=lambda p, b, s: moved(p, np.array([0.2 * s, 0.0, 0.0])), lasts_s=3.0),
        "poses drift up with 0.2 m/s": Fault(pose=lambda p, b, s: moved(p, np.array([0.0, 0.0, 0.2 * s])), lasts_s=3.0),
        "body turned by 90 deg": Fault(pose=lambda p, b, s: turned(p, np.pi / 2.0, False)),
        "world turned by 30 deg": Fault(pose=lambda p, b, s: turned(p, np.pi / 6.0, True)),
        "poses 20 % too far": Fault(pose=lambda p, b, s: p._replace(position_m=1.2 * p.position_m)),
        "poses with 2 cm of noise": Fault(pose=noisy), "poses at 20 Hz": Fault(pose=sparse),
        "pushed by 0.1 N": Fault(step=pushed(0.1, 0.0, 0.0)), "pushed down by 0.05 N": Fault(step=pushed(0, 0, -0.05)),
        "gust": Fault(step=gust), "wind of 2 m/s": Fault(world={"wind_m_s": (2.0, 0.0, 0.0)}),
        "battery empties": Fault(step=empty), "battery at 3.75 V": Fault(world={"battery_V": 3.75}),
        "Ctrl-C": Fault(step=interrupt),
        "controller raises": Fault(pilot=raises), "controller repeats itself": Fault(pilot=repeats()),
        "controller gives full thrust": Fault(pilot=lambda packet, s: full_thrust()),
        "controller gives no thrust": Fault(pilot=lambda packet, s: no_thrust()),
    }


def full_thrust() -> bytes:
    from nanobench_tools.radio.fly import setpoint_packets

    return setpoint_packets.rates(65535, np.zeros(3))


def no_thrust() -> bytes:
    from nanobench_tools.radio.fly import setpoint_packets

    return setpoint_packets.rates(10000, np.zeros(3))


class FaultyPilot:
    """A pilot whose packets pass through the fault."""

    def __init__(self, pilot: Any, world: FaultWorld, change: Callable[[bytes, float], bytes]) -> None:
        self._pilot, self._world, self._change = pilot, world, change

    def __getattr__(self, name: str) -> Any:
        return getattr(self._pilot, name)

    def packet(self, *given: Any) -> bytes:
        packet: bytes = self._pilot.packet(*given)
        since = self._world.since_s
        return self._change(packet, since) if since >= 0.0 else packet


@dataclasses.dataclass
class Flown:
    number: int
    seed: int
    fault: str
    controller: str
    path: str
    speed_m_s: float
    after_s: float
    began: bool
    stop: str
    outside_m: float
    drop_m: float

    @property
    def good(self) -> bool:
        return self.outside_m <= MOST_OUTSIDE_M and self.drop_m <= MOST_DROP_M


def fly(name: str, number: int, seed: int) -> Flown:
    rng = np.random.default_rng([seed, number])
    controller = CONTROLLERS[number % len(CONTROLLERS)]
    family, size = PATHS[int(rng.integers(len(PATHS)))]
    speed, after_s = float(rng.uniform(0.5, 1.0)), float(rng.uniform(1.0, 9.0))
    fault = faults()[name]
    world = FaultWorld(fault, after_s, seed + number)
    spec = chosen_path(family, speed, size, 6.0)
    pilot: Any = pilot_for(controller, None, None)
    if fault.pilot is not None:
        pilot = FaultyPilot(pilot, world, fault.pilot)
    plans: list[Plan] = []
    stop = ""
    with world.served() as uri:
        try:
            result = fly_session(Request(spec, pilot, Limits(), uri, world, (), clock=world))
            plans.append(result.ready.plan)
            stop = str(result.outcome.stop or "")
        except Exception as error:
            stop = f"{type(error).__name__}: {error}"
    began = world.since_s >= 0.0
    world.sleep_until(world.now() + AFTERWARDS_S)
    seen = np.array(world.seen)
    outside, drop = judged(seen, plans[0] if plans else None)
    return Flown(number, seed, name, controller, family, round(speed, 2), round(after_s, 2), began, stop, outside, drop)


def judged(seen: np.ndarray, plan: Plan | None) -> tuple[float, float]:
    """Largest distance from the plan (over the ground, or above its highest point), and the largest height lost while
    the motors stood still."""
    places = np.zeros((1, 3)) if plan is None else plan.at(np.arange(0.0, plan.ends["hover at end"], 0.02)).position_m
    over = np.array([np.linalg.norm(places[:, :2] - p, axis=1).min() for p in seen[::5, 1:3]])
    above = seen[:, 3] - places[:, 2].max()
    drop, top = 0.0, 0.0
    for z, motors in seen[:, 3:5]:
        top = max(top, z) if motors == 0.0 else 0.0
        drop = max(drop, top - z)
    return float(max(over.max(), above.max())), float(drop)


def table(flown: list[Flown]) -> str:
    lines = ["| fault | n | failed | outside m | drop m | ended by |", "| --- | --- | --- | --- | --- | --- |"]
    for name in dict.fromkeys(f.fault for f in flown):
        of = [f for f in flown if f.fault == name]
        rules = ", ".join(dict.fromkeys(f.stop.partition(":")[0] or "flown" for f in of))
        lines.append(f"| {name} | {len(of)} | {sum(not f.good for f in of)} | {max(f.outside_m for f in of):.2f} | "
                     f"{max(f.drop_m for f in of):.2f} | {rules} |")
    bad = sum(not f.good for f in flown)
    lines += ["", f"SYNTHETIC. {len(flown)} flights, {len({f.fault for f in flown})} faults: {bad} failed "
              f"(more than {MOST_OUTSIDE_M} m outside the plan, or motors off above {MOST_DROP_M} m)"]
    return "\n".join(lines)


def kept(path: Path | None) -> list[Flown]:
    return [] if path is None or not path.exists() else [Flown(**row) for row in json.loads(path.read_text())]


def keep(path: Path | None, flown: list[Flown]) -> None:
    """An interruption leaves the old file or the new one."""
    if path is not None:
        new = path.with_suffix(".new")
        new.write_text(json.dumps([dataclasses.asdict(f) for f in flown], indent=1))
        new.replace(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=80)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--fault", action="append")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--for-s", type=float, default=np.inf)
    given = parser.parse_args()
    names = given.fault or list(faults())
    begun, flown = time.monotonic(), kept(given.json)
    have = {(f.seed, f.number, f.fault) for f in flown}
    for number in range(given.flights):
        name = names[number % len(names)]
        if (given.seed, number, name) in have:
            continue
        if time.monotonic() - begun > given.for_s:
            break
        flown.append(last := fly(name, number, given.seed))
        print(f"{number} {last.fault}, {last.controller}: {'' if last.good else 'FAILED '}outside {last.outside_m:.2f} "
              f"m, drop {last.drop_m:.2f} m; {last.stop or 'flown'}", file=sys.stderr, flush=True)
        keep(given.json, flown)
    print(table(flown))


if __name__ == "__main__":
    main()

"""Whether memory grows while controllers and plants run: resident memory of the process, a mark every twentieth.

    python benchmarks/studies/steady_memory.py [--steps 1000000] [--what mpc_daqp --what plant ...]

SYNTHETIC. ``mpc_daqp``, ``mpc_osqp``, ``nmpc``: commands round a figure of eight with pushes (``mpc_speed``);
``plant``: steps of 2 ms of 16 vehicles of Task 2's plant. They fly behind the firmware's PID, ``mellinger_full``,
``geometric`` and ``lqr``. Each is called at every step; ``served``: milliseconds of the vehicle that ``nanobench
simulate --serve`` serves, its loop included. Growth is the median of the last quarter of the marks less that of the
second. Memory taken once at the beginning thus does not count.
"""

import argparse
import os
import sys
from collections.abc import Callable

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

PLANTS = {"plant": "onboard_pid", "mellinger_full": "mellinger_full", "geometric": "geometric", "lqr": "lqr"}
"""Kind -> the controller in front of the batched plant."""
KINDS = ("mpc_daqp", "mpc_osqp", "nmpc", *PLANTS, "served")
MARKS = 20


def resident_MB() -> float:
    """Of this process."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def commands(name: str, steps: int, mark: Callable[[], None]) -> None:
    """Of a predictive controller."""
    from mpc_speed import FRESH, PRACTICE, MpcDaqp, MpcOsqp, Nmpc, flown

    kind = {"mpc_daqp": MpcDaqp, "mpc_osqp": MpcOsqp, "nmpc": Nmpc}[name]
    every = max(steps // MARKS, 1)
    flown(kind(PRACTICE, tuning=FRESH), steps, lambda k, _: mark() if k % every == every - 1 else None)


def plant(name: str, steps: int, mark: Callable[[], None]) -> None:
    """Of a controller in front of 16 vehicles that hover."""
    from controllers.plants.ensemble import draw, shipped_simulator
    from nanobench_tools.lookup.registry import load
    from nanobench_tools.methods import Reference, VehicleState

    n = 16
    goal = np.tile([0.0, 0.0, 1.0], (n, 1))
    told, vehicles = Reference(goal, np.zeros(n), 0 * goal, 0 * goal), None
    controller = load("controllers", PLANTS[name])()
    for k in range(steps):
        if k % 50_000 == 0:  # a new flight: cells are empty after some minutes
            vehicles = draw(shipped_simulator(), n).plant(goal)
            controller.reset(n)
        s = vehicles.state
        state = VehicleState(s[0:3].T, s[3:6].T, s[6:10].T, s[10:13].T, vehicles.battery_V)
        vehicles.advance(controller.command(vehicles.step_s * k, state, told))
        if k % max(steps // MARKS, 1) == max(steps // MARKS, 1) - 1:
            mark()


def served(steps: int, mark: Callable[[], None]) -> None:
    from controllers.plants.served_vehicle import served as made

    vehicle, part = made(battery_V=4.1), max(steps // MARKS, 1)
    vehicle.stabilizer.loop["override"] = 1
    vehicle.stabilizer.loop["direct"] = 30000
    for _ in range(MARKS):
        vehicle.advance(part)
        mark()


def grown(name: str, steps: int) -> tuple[float, list[float]]:
    """Growth [MB] over a quarter to the end, and the marks [MB]."""
    marks: list[float] = []

    def mark() -> None:
        marks.append(resident_MB())
        print(f"\r{name:9} {len(marks)}/{MARKS}: {marks[-1]:.1f} MB ", end="", file=sys.stderr, flush=True)

    if name == "served":
        served(steps, mark)
    elif name in PLANTS:
        plant(name, steps, mark)
    else:
        commands(name, steps, mark)
    quarter = len(marks) // 4
    return float(np.median(marks[-quarter:]) - np.median(marks[quarter:2 * quarter])), marks


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--what", action="append", choices=KINDS, help="default: all")
    given = parser.parse_args()
    for name in given.what or KINDS:
        growth, marks = grown(name, given.steps)
        print(f"\r{name:9} {given.steps} steps: {growth:+.2f} MB; marks", *(f"{m:.1f}" for m in marks), flush=True)


if __name__ == "__main__":
    main()

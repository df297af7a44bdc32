"""How fast practice flights are made: time per flight alone and in one batch, and the parts of it.

    python benchmarks/speed/practice_speed.py [--flights 200]
"""

import argparse
import time
from collections.abc import Callable
from typing import Any

from kept import show

from nanobench_tools.practice import LoggingChain, path_spec, practice_flights
from nanobench_tools.practice.flights import SPEEDS
from nanobench_tools.practice.flying import flight_rngs, fly
from nanobench_tools.practice.logging_chain import record
from nanobench_tools.practice.onboard_crowd import OnboardFleet
from nanobench_tools.practice.references import RECORDED


def timed(work: Callable[[], Any]) -> tuple[Any, float, float]:
    """Result, seconds on the wall, seconds of this process's CPU."""
    wall, cpu = time.perf_counter(), time.process_time()
    result = work()
    return result, time.perf_counter() - wall, time.process_time() - cpu


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--flights", type=int, default=200)
    n = parser.parse_args().flights
    specs = [path_spec(RECORDED[i % len(RECORDED)], SPEEDS[i % 3]) for i in range(n)]
    names = [("pid", "pid", "mellinger")[i % 3] for i in range(n)]
    _, wall_one, cpu_one = timed(lambda: fly(OnboardFleet(names[:1]), specs[:1]))
    flown, wall, cpu = timed(lambda: fly(OnboardFleet(names), specs))
    seconds = sum(0.01 * flown.ticks_of(i) for i in range(n))
    print(f"one flight of {flown.time_s[-1]:.0f} s flown alone: {wall_one:.1f} s wall, {cpu_one:.1f} s CPU")
    print(f"{n} flights, {seconds:.0f} s of flight, flown in one batch: {wall:.1f} s wall, {cpu:.1f} s CPU; "
          f"{seconds / cpu:.0f} times real time, {n * cpu_one / cpu:.0f} times faster than one after the other")
    show("one flight after the other / one batch", n * cpu_one / cpu, n)
    _, wall, cpu = timed(lambda: [record(flown, i, LoggingChain(), flight_rngs(0, i, 9)[6:]) for i in range(n)])
    print(f"logging chain: {wall:.1f} s wall, {1e3 * cpu / n:.0f} ms CPU per flight")
    _, wall, cpu = timed(lambda: practice_flights(n, 0))
    print(f"practice_flights({n}): {wall:.1f} s wall, {cpu:.1f} s CPU")


if __name__ == "__main__":
    main()

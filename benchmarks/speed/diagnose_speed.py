"""How long a diagnosis takes, and that it grows with the number of flights in proportion: five, ten, twenty flights.

    python benchmarks/speed/diagnose_speed.py [--flights 5 10 20] [--seconds 40] [--jobs 2]

SYNTHETIC flights of one vehicle, 40 s each and different paths, by two onboard controllers, through the logging chain
with a telemetry clock that wanders. The simulator is the vehicle's without its drag, so that something is named and
proved. Times the steps of ``nanobench diagnose``: audit, re-timing, residual, identification, proof; reading and the
page are not included. Time of plain NumPy steps of the simulator says how fast the machine is. With ``--jobs 1`` the
processor's time is printed too, which other work on the machine does not lengthen as much. Nothing is cached between
runs but compiled code, which a first run of two flights pays for. Exit code 1 when five flights of 40 s take longer
than 60 s.
"""

import argparse
import os
import sys
import time
from typing import Any

import numpy as np
from kept import show
from model_speed import best_time, made_windows

from identification.mismatch.diagnosis import diagnose
from identification.mismatch.recordings import look_over
from identification.prove.airframe import draw_airframe
from identification.prove.case_kinds import CaseSpec, FlightSpec, Nuisance
from identification.prove.make import make_case
from nanobench_tools.flight import Flight
from nanobench_tools.harness.audits import audit_flights
from nanobench_tools.harness.clocks import on_clock
from nanobench_tools.physics import Model, numeric
from nanobench_tools.practice.references import path_spec

AIM_S, AIM_FLIGHTS = 60.0, 5
PLAIN_WINDOWS = 400
FAMILIES = ("circle", "figure_eight", "trefoil", "helix", "oval", "star")
SPEEDS = ("medium", "slow", "fast")


def flights_of(many: int, seconds: float, seed: int) -> tuple[list[Flight], Model]:
    """Flights of one vehicle and a simulator of it that lacks its drag."""
    airframe = draw_airframe(np.random.default_rng(seed))
    paths = [path_spec(FAMILIES[k % len(FAMILIES)], SPEEDS[k // len(FAMILIES) % len(SPEEDS)], duration_s=seconds)
             for k in range(many)]
    flown = tuple(FlightSpec(path, ("pid", "mellinger")[k % 2], 0.9) for k, path in enumerate(paths))
    nuisance = Nuisance(clock_wander_s=0.015, clock_offset_s=0.01)
    case = make_case(CaseSpec("speed", "single", seed, 0, airframe, flown, (), (), (), nuisance))
    return list(case.flights), case.simulator.without("drag_linear")


def timed(flights: list[Flight], simulator: Model, jobs: int) -> dict[str, Any]:
    """Seconds of each part, and what came out."""
    marks, cpu = [time.perf_counter()], time.process_time()
    audits = audit_flights(flights, None, jobs).audits
    marks.append(time.perf_counter())
    moved = on_clock(flights, audits, "joint", jobs=jobs)
    marks.append(time.perf_counter())
    recordings = look_over(flights, audits, moved.flights, moved.audits)
    verdict = diagnose(recordings, simulator)
    marks.append(time.perf_counter())
    parts = dict(zip(("audit_s", "clock_s", "diagnosis_s"), np.diff(marks).tolist(), strict=True))
    return {"flights": len(flights), "flown_s": float(sum(f.metadata["duration_s"] for f in flights)),
            "judged_s": recordings.judged_s, **parts, "total_s": marks[-1] - marks[0],
            "cpu_s": time.process_time() - cpu if jobs == 1 else None,
            "outcome": verdict.body["outcome"], "named": [f["term"] for f in verdict.body["findings"]]}


def growth(rows: list[dict[str, Any]]) -> float:
    """Exponent of time (of the processor, where it is known) over flights, fewest to most: 1 is linear."""
    first, last = rows[0], rows[-1]
    kind = "total_s" if first["cpu_s"] is None else "cpu_s"
    return float(np.log(last[kind] / first[kind]) / np.log(last["flights"] / first["flights"]))


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, nargs="+", default=[5, 10, 20])
    parser.add_argument("--seconds", type=float, default=40.0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=5)
    options = parser.parse_args(argv)
    every, simulator = flights_of(max(options.flights), options.seconds, options.seed)
    before = time.perf_counter()
    timed(every[:2], simulator, options.jobs)
    print(f"SYNTHETIC flights of {options.seconds:g} s, {options.jobs} jobs, {os.cpu_count()} cores, load "
          f"{os.getloadavg()[0]:.1f}; first run with two flights, which compiles: {time.perf_counter() - before:.1f} s")
    print(" flights  judged s  audit s  clock s  diagnosis s  total s  s/flight  processor s")
    rows = []
    for many in sorted(options.flights):
        row = timed(every[:many], simulator, options.jobs)
        rows.append(row)
        print(f"{many:8d} {row['judged_s']:9.0f} {row['audit_s']:8.1f} {row['clock_s']:8.1f} "
              f"{row['diagnosis_s']:12.1f} {row['total_s']:8.1f} {row['total_s'] / many:9.2f} "
              f"{'-' if row['cpu_s'] is None else format(row['cpu_s'], '.1f'):>12}   {row['outcome']} "
              f"{', '.join(row['named'])}", flush=True)
    if len(rows) > 1:
        print(f"time grows with flights to the power {growth(rows):.2f} (1 is linear)")
    five = next((r for r in rows if r["flights"] == AIM_FLIGHTS), None)
    if five is None:
        return 0
    plain_s = best_time(lambda: numeric.rollout(simulator, *made_windows(PLAIN_WINDOWS)), 3)
    show(f"{PLAIN_WINDOWS} plain NumPy windows / diagnosis of one flight second",
         plain_s * five["flown_s"] / five["total_s"], len(rows))
    print(f"five flights of {options.seconds:g} s: {five['total_s']:.1f} s"
          + ("" if five["cpu_s"] is None else f", {five['cpu_s']:.1f} s of one processor") + f"; aim {AIM_S:g} s")
    return int(five["total_s"] > AIM_S)


if __name__ == "__main__":
    sys.exit(main())

"""How well the moving clock error is recovered: injected on practice flights, and stream against stream on real ones.

    python benchmarks/clock_proof.py [--flights N] [--data DIR ...] [--jobs N]

Part 1 (SYNTHETIC): practice flights with no wander, and with a sawtooth of 31 ms SD; claimed SD, RMS error, and how
often the 95 % interval covers the truth. Part 2 (real): the clock from one group of streams judged on a stream of
the other, against the best constant; better and worse are flights whose residual changed by more than twice its
standard error.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from rich.console import Console
from rich.table import Table

from nanobench_tools.content.context import Context
from nanobench_tools.content.truth import truth_of
from nanobench_tools.flight import Flight, Provenance
from nanobench_tools.practice.clock import ClockError
from nanobench_tools.practice.flying import flight_rngs, fly
from nanobench_tools.practice.logging_chain import LoggingChain, record
from nanobench_tools.practice.onboard import OnboardFleet
from nanobench_tools.practice.references import FAMILIES, path_spec
from nanobench_tools.retiming.confirm import believed, gain_on
from nanobench_tools.retiming.infer import infer
from nanobench_tools.sources import default_data, load_recordings

CLOCKS = {"position, velocity": ("position", "velocity"), "gyro": ("gyro",), "all": None}


def practice_with_truth(n: int, wander_sd_s: float, seed: int) -> list[tuple[Flight, ClockError]]:
    """n practice flights of every family in turn, each with the clock error that was put in."""
    families = [f for f in FAMILIES if f != "linear_ramp"]
    specs = [path_spec(families[i % len(families)], ("slow", "medium", "fast")[i % 3]) for i in range(n)]
    flown = fly(OnboardFleet(["pid"] * n), specs, seed=seed, indices=list(range(n)))
    result = []
    for row in range(n):
        recorded = record(flown, row, LoggingChain(wander_sd_s=wander_sd_s), flight_rngs(seed, row, 9)[6:])
        flight = Flight(f"practice {row}", recorded.streams, {}, Provenance("practice", "", "practice", synthetic=True))
        result.append((flight, recorded.clock))
    return result


def true_lateness(clock: ClockError, stamps_s: np.ndarray) -> np.ndarray:
    """(n,) lateness of what was stamped ``stamps_s``."""
    sent = np.arange(stamps_s[0] - 1.0, stamps_s[-1] + 1.0, 0.001)
    return stamps_s - np.interp(stamps_s, sent + clock.late_s(sent), sent)


def score_injected(flight: Flight, clock: ClockError, kinds: tuple[str, ...] | None) -> tuple[float, ...]:
    """Claimed SD, RMS error, coverage of 1.96 SD and true SD, where the vehicle moves (constants removed)."""
    context = Context(flight)
    warp = believed(context) if kinds is None else infer(context, kinds)
    truth = context.once(truth_of)
    moving = np.interp(warp.time_s, truth.time_s, np.linalg.norm(truth.velocity_m_s, axis=1)) > 0.2
    actual = true_lateness(clock, warp.time_s)[moving]
    error = warp.offset_s[moving] - actual
    error = error - np.median(error)
    covered = np.mean(np.abs(error) < 1.96 * warp.sd_s[moving])
    return (float(np.std(warp.offset_s[moving])), float(np.sqrt(np.mean(error**2))), float(covered),
            float(np.std(actual)), float(warp.moving))


def score_real(flight: Flight) -> dict[str, tuple[float, float]]:
    """(gain, standard error) of each clock on a stream it did not use."""
    context = Context(flight)
    result = {}
    for name, kinds, judge in (("position, velocity -> gyro", ("position", "velocity"), "gyro"),
                               ("gyro -> position", ("gyro",), "position"),
                               ("gyro -> attitude", ("gyro",), "attitude"),
                               ("position, velocity -> attitude", ("position", "velocity"), "attitude")):
        warp = infer(context, kinds)
        if warp is not None:
            result[name] = gain_on(context, warp, judge)
    begun = time.perf_counter()
    final = believed(Context(flight))
    result["seconds"] = (time.perf_counter() - begun, float(final.moving) if final else 0.0)
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=21)
    parser.add_argument("--data", type=Path, action="append")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    console = Console(width=140)
    table = Table(title=f"SYNTHETIC: moving clock error, n = {options.flights} practice flights a row; median (p90)")
    for column in ("injected SD ms", "clock from", "claimed SD ms", "RMS error ms", "95 % interval covers",
                   "warp kept"):
        table.add_column(column)
    for sd in (0.0, 0.031):
        flights = practice_with_truth(options.flights, sd, seed=5)
        for name, kinds in CLOCKS.items():
            scores = np.array(Parallel(options.jobs)(delayed(score_injected)(f, c, kinds) for f, c in flights))
            claimed, error, covered, actual, kept = scores.T
            table.add_row(f"{1e3 * np.median(actual):.1f}", name,
                          f"{1e3 * np.median(claimed):.2f} ({1e3 * np.quantile(claimed, .9):.2f})",
                          f"{1e3 * np.median(error):.2f} ({1e3 * np.quantile(error, .9):.2f})",
                          f"{np.mean(covered):.3f}", f"{kept.mean():.2f}")
    console.print(table)
    places = options.data or default_data()
    if not places:
        console.print("REAL RECORDINGS ABSENT: part 2 was left out")
        return
    flights = {}
    for flight in load_recordings(places, jobs=options.jobs).flights:
        flights.setdefault((flight.epoch_s, len(flight.streams)), flight)  # copies have the same first stamp
    rows = Parallel(options.jobs)(delayed(score_real)(f) for f in flights.values() if not f.provenance.synthetic)
    table = Table(title="real recordings: the clock from some streams judged on another, against the best constant")
    for column in ("clock -> judge", "n", "residual variance removed, median (p10, p90)", "better", "worse"):
        table.add_column(column)
    for name in ("position, velocity -> gyro", "gyro -> position", "gyro -> attitude",
                 "position, velocity -> attitude"):
        scores = np.array([r[name] for r in rows if name in r])
        gain, error = scores.T
        p10, p90 = np.quantile(gain, (0.1, 0.9))
        table.add_row(name, str(len(gain)), f"{100 * np.median(gain):.0f} % ({100 * p10:.0f}, {100 * p90:.0f})",
                      str(int(np.sum(gain > 2 * error))), str(int(np.sum(gain < -2 * error))))
    console.print(table)
    seconds = np.array([r["seconds"] for r in rows])
    console.print(f"warp kept in {int(seconds[:, 1].sum())} of {len(rows)} recordings; "
                  f"{seconds[:, 0].sum():.0f} s of one core for all, median {np.median(seconds[:, 0]):.2f} s")


if __name__ == "__main__":
    main()

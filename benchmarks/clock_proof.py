"""How well the moving clock error is recovered: injected on practice flights, and stream against stream on real ones.

    python benchmarks/clock_proof.py [--flights N] [--seed N] [--data DIR ...] [--jobs N]

Part 1 (SYNTHETIC): practice flights with no wander, and with a sawtooth of 31 ms SD; claimed SD, RMS error, and how
often the 95 % interval covers the truth. Part 2 (real recordings, copies left out): a clock from some streams judged on
a stream it never saw, against the best constant; each judged stream may choose its own constant lag, so that a
constant cannot win. ``product``: what --clock retimed does, which leaves a flight alone when nothing is confirmed.
``causal``: uses nothing later than 0.06 s after each row, with noise and lags that are typical and not learnt.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from rich.console import Console
from rich.table import Table
from scipy.signal import butter, sosfiltfilt

from nanobench_tools import so3
from nanobench_tools.content.airborne import airborne_spans
from nanobench_tools.content.context import Context
from nanobench_tools.content.tails import alive_until
from nanobench_tools.content.truth import body_rate, truth_of
from nanobench_tools.flight import Flight, Provenance
from nanobench_tools.practice.clock import ClockError
from nanobench_tools.practice.flying import flight_rngs, fly
from nanobench_tools.practice.logging_chain import LoggingChain, record
from nanobench_tools.practice.onboard import OnboardFleet
from nanobench_tools.practice.references import RECORDED, path_spec
from nanobench_tools.protocols.selection import distinct
from nanobench_tools.retiming.apply import find_warp
from nanobench_tools.retiming.confirm import believed, gain_on
from nanobench_tools.retiming.infer import infer
from nanobench_tools.retiming.warp import ClockWarp
from nanobench_tools.sources import default_data, load_recordings

CLOCKS = {"position, velocity": ("position", "velocity"), "gyro, acceleration": ("gyro", "acceleration"),
          "product": None}


def practice_with_truth(n: int, wander_sd_s: float, seed: int) -> list[tuple[Flight, ClockError]]:
    """n practice flights of every family in turn, each with the clock error that was put in."""
    families = [f for f in RECORDED if f != "linear_ramp"]
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


def band(values: np.ndarray) -> np.ndarray:
    """(n, k) at 100 Hz, 0.3-8 Hz."""
    return sosfiltfilt(butter(2, (0.3, 8.0), btype="band", fs=100.0, output="sos"), values, axis=0)


def likeness(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sum(a * b) / np.sqrt(np.sum(a * a) * np.sum(b * b)))


def moved(stamps_s: np.ndarray, values: np.ndarray, warp: ClockWarp | None, grid_s: np.ndarray) -> np.ndarray:
    """Values on the grid after the stamps were moved by ``warp``."""
    t = stamps_s if warp is None else np.maximum.accumulate(stamps_s - warp.at(stamps_s))
    last = np.concatenate((np.diff(t) > 0.0, [True]))
    return np.stack([np.interp(grid_s, t[last], values[last, k]) for k in range(values.shape[1])], axis=1)


def flown(context: Context, streams: tuple[str, ...]) -> tuple[float, float]:
    """Start and end [s] of the flight while the streams lived."""
    span, alive = context.once(airborne_spans), context.once(alive_until)
    return span[0].start_s, min(span[-1].end_s, *(alive[name] - 0.1 for name in streams))


def constant(warp: ClockWarp) -> ClockWarp:
    none = np.zeros(0)
    return replace(warp, time_s=none, offset_s=none, sd_s=none, moving=False)


def rates(context: Context, warp: ClockWarp | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lateral rates of the gyro, of the onboard attitude, and of the motion capture at the gyro's best lag; (n, 2)."""
    start_s, end_s = flown(context, ("imu", "attitude_qw"))
    grid = np.arange(start_s, end_s, 0.01)
    truth = context.once(truth_of)
    imu, attitude = context.flight["imu"], context.flight["attitude_qw"]
    gyro = band(moved(imu.time_s, imu["gyro_x", "gyro_y"], warp, grid))
    q = so3.make_continuous(moved(attitude.time_s, so3.make_continuous(attitude["qx", "qy", "qz", "qw"]), warp, grid))
    onboard = band(body_rate(q / np.linalg.norm(q, axis=1, keepdims=True), 0.01)[:, :2])
    lagged = [band(np.stack([np.interp(grid - lag, truth.time_s, truth.rate_rad_s[:, k]) for k in range(2)], axis=1))
              for lag in np.arange(-0.12, 0.121, 0.005)]
    return gyro, onboard, max(lagged, key=lambda m: likeness(m, gyro))


def off_track(context: Context, warp: ClockWarp | None, slowest_m_s: float = 0.15) -> tuple[float, float]:
    """RMS error of the onboard position along and across its path [m] at its best lag, where the vehicle moves."""
    (start_s, end_s), truth, s = flown(context, ("estimator",)), context.once(truth_of), context.flight["estimator"]
    t = s.time_s if warp is None else s.time_s - warp.at(s.time_s)
    best = (float("inf"), float("nan"))
    for lag in np.arange(-0.1, 0.1001, 0.0025):
        inside = (s.time_s > start_s) & (s.time_s < end_s)
        at = t[inside] - lag
        p, v = (np.stack([np.interp(at, truth.time_s, x[:, k]) for k in range(3)], axis=1)
                for x in (truth.position_m, truth.velocity_m_s))
        error = s["x", "y", "z"][inside] - p
        error = error - np.median(error, axis=0)
        speed = np.linalg.norm(v, axis=1)
        use = speed > slowest_m_s
        if use.sum() < 100:
            return float("nan"), float("nan")
        along = np.sum(error * v, axis=1)[use] / speed[use]
        across = np.sqrt(np.maximum(np.sum(error[use] ** 2, axis=1) - along**2, 0.0))
        best = min(best, (float(np.sqrt(np.mean(along**2))), float(np.sqrt(np.mean(across**2)))))
    return best


def score_real(flight: Flight) -> dict[str, tuple[float, ...]] | None:
    """Figures of every clock, None for a recording in which nothing can be compared."""
    context = Context(flight)
    if not context.once(airborne_spans) or context.once(truth_of) is None or not {
            "imu", "estimator", "attitude_qw"} <= set(flight.streams):
        return None
    begun = time.process_time()
    final = believed(context)
    spent = time.process_time() - begun
    inertial = find_warp(flight, "retimed", judges_estimator=True)
    from_position = infer(context, ("position", "velocity"))
    if from_position is None or inertial is None:
        return None
    fixed = constant(from_position)
    clocks = {"constant": fixed, "product": from_position if final is not None and final.moving else fixed,
              "causal": infer(context, ("position", "velocity"), causal=True)}
    result: dict[str, tuple[float, ...]] = {"seconds": (spent, float(final is not None and final.moving))}
    for name, warp in clocks.items():
        gyro, onboard, seen = rates(context, warp)
        result[f"gyro {name}"] = (likeness(gyro, seen), likeness(onboard, seen), likeness(gyro, onboard))
    for name, warp in {"constant": constant(inertial), "product": inertial if inertial.moving else constant(inertial),
                       "causal": infer(context, ("gyro", "acceleration"), causal=True)}.items():
        result[f"track {name}"] = off_track(context, warp)
    for kinds, judge in ((("position", "velocity"), "gyro"), (("gyro", "acceleration"), "attitude"),
                         (("gyro", "acceleration"), "position")):
        warp = infer(context, kinds)
        if warp is not None:
            result[f"gain {', '.join(kinds)} -> {judge}"] = gain_on(context, warp, judge)
    return result


def real_tables(console: Console, rows: list[dict[str, tuple[float, ...]]]) -> None:
    """The figures of all flights: medians, and how many flights are better and worse than with a constant."""
    table = Table(title=f"real recordings, n = {len(rows)}: medians; better / worse than the best constant offset")
    for column in ("clock", "gyro to mocap, 0.3-8 Hz (clock from position, velocity)", "better", "worse",
                   "along track mm (clock from gyro, acceleration, odometry)", "across mm", "better", "worse"):
        table.add_column(column)
    for name in ("constant", "product", "causal"):
        gyro, track = (np.array([r[f"{what} {name}"] for r in rows]) for what in ("gyro", "track"))
        base, trail = (np.array([r[f"{what} constant"] for r in rows]) for what in ("gyro", "track"))
        table.add_row(name, f"{np.median(gyro[:, 0]):.3f}", str(int(np.sum(gyro[:, 0] > base[:, 0] + 0.005))),
                      str(int(np.sum(gyro[:, 0] < base[:, 0] - 0.005))), f"{1e3 * np.nanmedian(track[:, 0]):.1f}",
                      f"{1e3 * np.nanmedian(track[:, 1]):.1f}", str(int(np.sum(track[:, 0] < trail[:, 0] - 0.0005))),
                      str(int(np.sum(track[:, 0] > trail[:, 0] + 0.0005))))
    console.print(table)
    three = np.median([r["gyro product"] for r in rows], axis=0)
    console.print(f"what bounds the gyro figure, re-timed: gyro to onboard attitude {three[2]:.3f}, while the motion "
                  f"capture agrees with the gyro to {three[0]:.3f} and with the onboard attitude to {three[1]:.3f}")
    for name in sorted({key for r in rows for key in r if key.startswith("gain")}):
        gain, error = np.array([r[name] for r in rows if name in r]).T
        console.print(f"{name}: residual variance removed, median {100 * np.median(gain):.0f} %; better (2 standard "
                      f"errors) in {int(np.sum(gain > 2 * error))}, worse in {int(np.sum(gain < -2 * error))} of "
                      f"{len(gain)}")
    seconds = np.array([r["seconds"] for r in rows])
    console.print(f"moving error confirmed in {int(seconds[:, 1].sum())} of {len(rows)}; {seconds[:, 0].sum():.0f} s "
                  f"of processor for all, median {np.median(seconds[:, 0]):.2f} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=21)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--data", type=Path, action="append")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    console = Console(width=140)
    table = Table(title=f"SYNTHETIC: moving clock error, n = {options.flights} practice flights a row; median (p90)")
    for column in ("injected SD ms", "clock from", "claimed SD ms", "RMS error ms", "95 % interval covers",
                   "warp kept"):
        table.add_column(column)
    for sd in (0.0, 0.031):
        flights = practice_with_truth(options.flights, sd, options.seed)
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
    flights = distinct([f for f in load_recordings(places, jobs=options.jobs).flights if not f.provenance.synthetic])[0]
    rows = [r for r in Parallel(options.jobs)(delayed(score_real)(f) for f in flights) if r]
    real_tables(console, rows)


if __name__ == "__main__":
    main()

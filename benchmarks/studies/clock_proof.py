"""Value of the re-timing clocks: the errors they remove, those they must leave, and how far they can be trusted.

    python benchmarks/studies/clock_proof.py [--flights N] [--seed N] [--every N] [--data DIR ...] [--jobs N]
                                             [--json FILE]

Part 1 (SYNTHETIC): practice flights with no wander, and with a sawtooth of 31 ms SD. Reports claimed SD, RMS error,
and how often the 95 % interval covers the truth.
Part 2, nulls: an along-track error of the estimated position is put into recordings, and a clock that judges the
estimate has to leave it. The error is 30 ms times speed, at .3, 1, 3 Hz and smoothly random, alone and in position and
velocity together. A wander of the timestamps (sawtooth of 20 ms SD), alone and together with such an error: the clock
has to remove it. Part 3: the onboard estimate along and across its track by clock. Also a clock from some streams
judged on an unused stream, against the best constant. Each judged stream may choose its own constant lag, so that a
constant cannot win. ``causal``: uses nothing later than 0.06 s after each row, with noise and lags that are typical
and not learnt. Without recordings parts 2 and 3 use the practice flights, and say SYNTHETIC. Copies are left out. The
constants of the clocks were set on the NanoBench dataset (``nanobench settings retiming``), so these flights are no
held-out ones.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from rich.console import Console
from rich.table import Table

from nanobench_tools.auditing.selection import distinct
from nanobench_tools.flight import Flight, Provenance
from nanobench_tools.metrics.statistics import summary
from nanobench_tools.practice import nulls
from nanobench_tools.practice.clock import ClockError
from nanobench_tools.practice.flying import flight_rngs, fly
from nanobench_tools.practice.logging_chain import LoggingChain, record
from nanobench_tools.practice.onboard_crowd import OnboardFleet
from nanobench_tools.practice.references import RECORDED, path_spec
from nanobench_tools.protocols.sessions import Sessions
from nanobench_tools.results.result_files import write_json
from nanobench_tools.signals.airborne import airborne_spans
from nanobench_tools.signals.context import Context
from nanobench_tools.signals.mocap_derivatives import derivatives_of
from nanobench_tools.sources import default_data, load_recordings
from nanobench_tools.time_offsets.moving.apply import find_time_offset
from nanobench_tools.time_offsets.moving.confirm import gain_on
from nanobench_tools.time_offsets.moving.infer import infer
from nanobench_tools.time_offsets.moving.time_offset import TimeOffset
from nanobench_tools.time_offsets.moving.votes import voters

CLOCKS: dict[str, tuple[str, ...] | str] = {
    "gyro, acceleration": ("gyro", "acceleration"), "gyro, acceleration, attitude": voters("retimed"),
    "all, position too": voters("joint"), "--clock retimed": "retimed", "--clock joint": "joint"}
NULLS = {"gyro, acceleration": voters("retimed", ("attitude",)), "gyro, acceleration, attitude": voters("retimed"),
         "all, position too": voters("joint")}
"""The first judges attitudes, the second positions and velocities; the last judges no estimate, and shows why."""
AMPLITUDE_S, WANDER_S = 0.03, 0.02
FREQUENCIES_HZ = (0.3, 1.0, 3.0, nulls.RANDOM)
BRACKET: dict[str, Callable[[Flight], TimeOffset | None]] = {
    "as recorded": lambda flight: None,
    "offset": lambda flight: find_time_offset(flight, "offset"),
    "gyro, acceleration": lambda flight: find_time_offset(flight, "retimed", ("attitude",)),
    "retimed: gyro, acceleration, attitude": lambda flight: find_time_offset(flight, "retimed",
                                                                             ("position", "velocity")),
    "joint: position too (no judgement)": lambda flight: find_time_offset(flight, "joint"),
    "retimed, causal": lambda flight: infer(Context(flight), ("gyro", "acceleration"), causal=True)}


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


def score_injected(flight: Flight, clock: ClockError, kinds: tuple[str, ...] | str) -> tuple[float, ...]:
    """Claimed SD, RMS error, coverage of 1.96 SD and true SD, where the vehicle moves (constants removed)."""
    context = Context(flight)
    time_offset = find_time_offset(flight, kinds, ()) if isinstance(kinds, str) else infer(context, kinds)
    truth = context.once(derivatives_of)
    moving = np.interp(time_offset.time_s, truth.time_s, np.linalg.norm(truth.velocity_m_s, axis=1)) > 0.2
    actual = true_lateness(clock, time_offset.time_s)[moving]
    error = time_offset.offset_s[moving] - actual
    error = error - np.median(error)
    covered = np.mean(np.abs(error) < 1.96 * time_offset.sd_s[moving])
    return (float(np.std(time_offset.offset_s[moving])), float(np.sqrt(np.mean(error**2))), float(covered),
            float(np.std(actual)), float(time_offset.moving))


def usable(flight: Flight) -> bool:
    """Whether the flight flew, long enough, with everything that is compared."""
    context = Context(flight)
    return (bool(context.once(airborne_spans)) and context.once(derivatives_of) is not None
            and {"imu", "estimator", "attitude_qw"} <= set(flight.streams)
            and len(nulls.along_track(context, None, 0.0)[0]) > 500)


def score_nulls(flight: Flight, seed: int) -> dict[str, nulls.Errors]:
    """{clock | case: errors} of every null of one flight."""
    flight = nulls.living(flight)
    before, result = Context(flight), {}
    time_offsets = {name: infer(before, kinds) for name, kinds in NULLS.items()}
    for frequency in FREQUENCIES_HZ:
        for both in (False, True):
            changed, error = nulls.with_track_error(flight, frequency, AMPLITUDE_S, seed, both)
            after = Context(changed)
            label = nulls.RANDOM if isinstance(frequency, str) else f"{frequency:g} Hz"
            case = f"{label}, position{' and velocity' * both}"
            for name, kinds in NULLS.items():
                result[f"{name}|{case}"] = nulls.track_errors(before, after, error, time_offsets[name],
                                                              infer(after, kinds))
    for both in (False, True):
        base = nulls.with_track_error(flight, nulls.RANDOM, AMPLITUDE_S, seed, True)[0] if both else flight
        wandering, clock = nulls.with_wander(base, WANDER_S, seed)
        steady, late = Context(base), Context(wandering)
        for name, kinds in NULLS.items():
            case = f"wander{', estimate errs too' * both}"
            result[f"{name}|{case}"] = nulls.wander_errors(before, clock, infer(steady, kinds), infer(late, kinds))
    return result


def score_bracket(flight: Flight) -> dict[str, tuple[float, ...]]:
    """{clock: (RMS error along the track m, whether it moves)}, {gain ...: (gain, error)} of one flight."""
    flight, result = nulls.living(flight), {}
    context = Context(flight)
    for name, find in BRACKET.items():
        time_offset = find(flight)
        along = nulls.along_track(context, time_offset, nulls.best_lag_s(context, time_offset))[0]
        result[name] = (float(np.sqrt(np.mean(along**2))), float(time_offset is not None and time_offset.moving))
    for kinds, judge in ((("position", "velocity"), "gyro"), (("gyro", "acceleration"), "attitude"),
                         (("gyro", "acceleration"), "position"), (voters("retimed"), "position")):
        time_offset = infer(context, kinds)
        if time_offset is not None:
            result[f"gain {', '.join(kinds)} -> {judge}"] = gain_on(context, time_offset, judge)
    return result


def null_table(console: Console, rows: Sequence[dict[str, nulls.Errors]], word: str) -> list[dict[str, object]]:
    cases = list(dict.fromkeys(key.split("|")[1] for key in rows[0]))
    table = Table(title=f"nulls, n = {len(rows)} {word} flights: share of an injected error's variance. Kept: an "
                        "estimate's error along the track; removed: a wander of the timestamps", title_justify="left")
    for column in ("clock from", *cases):
        table.add_column(column)
    found = []
    for name in NULLS:
        cells = []
        for case in cases:
            errors = [row[f"{name}|{case}"] for row in rows]
            share = nulls.removed(errors) if case.startswith("wander") else nulls.kept(errors)
            cells.append(f"{'removed' if case.startswith('wander') else 'kept'} {100 * share:.0f} %")
            found.append({"clock_evidence": list(NULLS[name]), "case": case, "n": len(rows),
                          ("removed" if case.startswith("wander") else "kept"): share})
        table.add_row(name, *cells)
    console.print(table)
    return found


def bracket_table(console: Console, flights: Sequence[Flight], rows: Sequence[dict[str, tuple[float, ...]]],
                  word: str) -> list[dict[str, object]]:
    sessions = Sessions.of(flights).labels(flights)
    table = Table(title=f"onboard estimate along its track, constant delay removed, n = {len(rows)} {word} flights",
                  title_justify="left")
    for column in ("clock", "mean RMS mm", "95 % interval", "median", "moves in"):
        table.add_column(column)
    found = []
    for name in BRACKET:
        values = np.array([row[name] for row in rows])
        told = summary(values[:, 0], 0, sessions)
        ends = told.ci95
        table.add_row(name, f"{1e3 * told.mean:.1f}", f"{1e3 * ends[0]:.1f} .. {1e3 * ends[1]:.1f}" if ends else "-",
                      f"{1e3 * told.median:.1f}", str(int(values[:, 1].sum())))
        found.append({"clock": name, "along_rms_m": told, "n_moving": int(values[:, 1].sum())})
    console.print(table)
    if why := found[0]["along_rms_m"].ci_why:
        console.print(f"intervals over flights within sessions: {why}")
    for name in sorted({key for row in rows for key in row if key.startswith("gain")}):
        gain, error = np.array([row[name] for row in rows if name in row]).T
        console.print(f"{name}: residual variance removed, median {100 * np.median(gain):.0f} %; better (2 standard "
                      f"errors) in {int(np.sum(gain > 2 * error))}, worse in {int(np.sum(gain < -2 * error))} of "
                      f"{len(gain)}")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=21, help="practice flights a row of part 1")
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--every", type=int, default=1, help="take every N-th recording in parts 2 and 3")
    parser.add_argument("--data", type=Path, action="append")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    console = Console(width=170)
    table = Table(title=f"SYNTHETIC: moving clock error, n = {options.flights} practice flights a row; median (p90)",
                  title_justify="left")
    for column in ("injected SD ms", "clock from", "claimed SD ms", "RMS error ms", "95 % interval covers",
                   "moving in"):
        table.add_column(column)
    recovered = []
    for sd in (0.0, 0.031):
        practice = practice_with_truth(options.flights, sd, options.seed)
        for name, kinds in CLOCKS.items():
            scores = np.array(Parallel(options.jobs)(delayed(score_injected)(f, c, kinds) for f, c in practice))
            claimed, error, covered, actual, kept = scores.T
            table.add_row(f"{1e3 * np.median(actual):.1f}", name,
                          f"{1e3 * np.median(claimed):.2f} ({1e3 * np.quantile(claimed, .9):.2f})",
                          f"{1e3 * np.median(error):.2f} ({1e3 * np.quantile(error, .9):.2f})",
                          f"{np.mean(covered):.3f}", f"{kept.mean():.2f}")
            recovered.append({"injected_sd_s": float(np.median(actual)), "clock": name, "n": options.flights,
                              "claimed_sd_s": float(np.median(claimed)), "error_rms_s": float(np.median(error)),
                              "covered": float(np.mean(covered)), "moving": float(kept.mean())})
    console.print(table)
    places = options.data or default_data()
    if not places:
        console.print("REAL RECORDINGS ABSENT: practice flights in their place, SYNTHETIC")
        flights = [flight for flight, _ in practice]
    else:
        flights = distinct([f for f in load_recordings(places, jobs=options.jobs).flights
                            if not f.provenance.synthetic])[0]
    word = "real" if places else "SYNTHETIC"
    flights = [flight for flight in flights if usable(flight)][::options.every]
    tested = Parallel(options.jobs)(delayed(score_nulls)(f, 1000 + i) for i, f in enumerate(flights))
    seen = Parallel(options.jobs)(delayed(score_bracket)(f) for f in flights)
    found = {"schema": "clock_proof", "synthetic": not places, "recovered": recovered,
             "nulls": null_table(console, tested, word), "bracket": bracket_table(console, flights, seen, word)}
    if options.json:
        write_json(options.json, found)


if __name__ == "__main__":
    main()

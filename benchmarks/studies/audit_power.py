"""What the audit finds and what it invents, on practice flights: false alarms, power per kind and size, clock offsets.

python benchmarks/studies/audit_power.py [--clean 200] [--each 8] [--offsets 200] [--seed 1] [--json FILE]

Clean: flights as the logging chain writes them. The continued straight line at their end is a true fault and must be
found where the chain put it. Power: every injection of ``practice.inject`` at every size and case, in ``--each``
flights. An injection is found if kind and an affected stream agree and the times overlap. Offsets: drawn from
-100..100 ms.
"""

import argparse
import collections
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from nanobench_tools.auditing.faults.clock_offset import SMALLEST_S
from nanobench_tools.auditing.faults.estimator_reset import ACROSS_M, ALONG_M, ALONG_S, SURELY
from nanobench_tools.auditing.faults.kinds import those
from nanobench_tools.auditing.faults.saturated_sensor import FEWEST_ROWS
from nanobench_tools.auditing.recording_audit import Audit, audit, find_copies
from nanobench_tools.flight import Fault, Flight
from nanobench_tools.practice import LoggingChain, practice_flights
from nanobench_tools.practice.inject import INJECTIONS
from nanobench_tools.results.result_files import write_json
from nanobench_tools.signals.axis_unit_matching import CLEAR, axis_unit_matches
from nanobench_tools.signals.context import Context
from nanobench_tools.signals.packet_rows import packets_of
from nanobench_tools.signals.spikes import LIMITS, least_height
from nanobench_tools.time_offsets.constant.drift_and_wander import moving_clocks
from nanobench_tools.time_offsets.constant.readings import read_clocks

INFORMATION = those(lambda kind: not kind.in_overview)
TRUE_TAIL_S = 0.15
"""The audit may place a dead end this far from where the chain cut the stream: one packet and one row, more after a
loss."""


def interval(hits: int, n: int) -> str:
    """hits of n with the exact 95 % interval."""
    if not n:
        return "none"
    ci = binomtest(hits, n).proportion_ci(method="exact")
    return f"{hits}/{n} ({ci.low:.3f}-{ci.high:.3f})"


def false_alarms(flight: Flight, verdict: Audit) -> list[Fault]:
    """Faults that a flight straight from the chain does not have."""
    stopped = flight.span.end_s - flight.metadata["practice"]["tail_s"]
    false = []
    for fault in verdict.faults:
        true_tail = fault.kind == "dead_stream" and abs(fault.start_s - stopped) < (
            1.2 if fault.stream == "battery" else TRUE_TAIL_S
        )
        if fault.kind not in INFORMATION and not true_tail:
            false.append(fault)
    return false


def meets(found: Fault, truth: Fault) -> bool:
    """Same kind, a stream that was meant, overlapping times (0.2 s of room)."""
    same_stream = not truth.stream or not found.stream or found.stream == truth.stream
    columns = (
        set(found.columns) & set(truth.columns) or not truth.columns or not found.columns or found.columns == ("t",)
    )
    return (
        found.kind == truth.kind
        and same_stream
        and bool(columns)
        and (found.start_s <= truth.end_s + 0.2 and found.end_s >= truth.start_s - 0.2)
    )


def run_clean(flights: list[Flight]) -> tuple[list[Audit], dict]:
    """Audits of clean flights and the count of false alarms."""
    start = time.process_time()
    verdicts = [audit(flight) for flight in flights]
    seconds = (time.process_time() - start) / len(flights)
    false = [(f.name, x) for f, v in zip(flights, verdicts, strict=True) for x in false_alarms(f, v)]
    known = sum(v.controller == f.metadata["practice"]["controller"] for f, v in zip(flights, verdicts, strict=True))
    print(
        f"clean flights: {len(flights)}, false alarms {len(false)}, controller right {known}, "
        f"{seconds:.3f} s of processor each"
    )
    for name, fault in false:
        print(f"  FALSE {name}: {fault.kind} {fault.stream} {fault.start_s:.2f}-{fault.end_s:.2f} {fault.evidence}")
    return verdicts, {"n": len(flights), "false_alarms": len(false), "seconds": seconds}


def detectable(flight: Flight, bad: Flight, truth: Fault) -> bool:
    """Whether the fault in ``bad`` is at or above what the audit states as its smallest for this flight and stream."""
    context = Context(flight)
    if truth.kind in ("sign", "axis_swap"):
        stream = flight[truth.stream]
        wanted = {stream.quantities[stream.columns.index(c)] for c in truth.columns}
        if "acc_z" in wanted:
            return True  # gravity tells
        verdicts = [
            v for v in context.once(axis_unit_matches).values()
            if v.stream == truth.stream and wanted <= set(v.quantities)
        ]
        return any(
            all(k > CLEAR for q, k in zip(v.quantities, v.correlation, strict=True) if q in wanted) for v in verdicts
        )
    if truth.kind == "clock_offset":
        reading = context.once(read_clocks)["imu"]
        return reading.identifiable and abs(truth.size) > SMALLEST_S + 1.25 * (reading.ci95_s[1] - reading.ci95_s[0])
    if truth.kind == "clock_drift":
        clocks = context.once(moving_clocks).values()
        return any(abs(truth.size) * clock.span_s > clock.detectable_drift_s for clock in clocks)
    if truth.kind == "clock_wander":
        # a fast wander is noise to the windows, so what can be found depends on it
        return any(truth.size > clock.detectable_wander_s for clock in Context(bad).once(moving_clocks).values())
    if truth.kind == "gap" and truth.stream != "mocap":
        packets, t = context.once(packets_of)[truth.stream], flight[truth.stream].time_s
        around = (t > truth.start_s - 0.5) & (t < truth.end_s + 0.5)
        return float(packets.straight[around].mean()) < 0.5 and (truth.stream != "setpoint" or truth.size > 0.3)
    if truth.kind == "spike":
        stream = flight[truth.stream]
        column, row = stream.columns.index(truth.columns[0]), int(np.searchsorted(stream.time_s, truth.start_s))
        limit = np.array([LIMITS[truth.stream][stream.quantities[column]]])
        return truth.size > least_height(stream.values[:, [column]], row, row + 1, limit)[0]
    if truth.kind == "saturated_sensor":
        return truth.size >= FEWEST_ROWS
    if truth.kind == "estimator_reset":
        speed = np.linalg.norm(
            [flight["mocap"].interpolate(v, np.array([truth.start_s]))[0] for v in ("vx", "vy", "vz")]
        )
        return truth.size > SURELY * np.hypot(ALONG_M + ALONG_S * speed, ACROSS_M)
    return True


def run_power(flights: list[Flight], each: int, seed: int) -> list[dict]:
    """Power per kind, case and size."""
    rows = []
    for kind, injection in INJECTIONS.items():
        for case in injection.cases:
            for size in injection.sizes:
                hits, could, could_hits = 0, 0, 0
                stated: list[float] = []
                other: collections.Counter[str] = collections.Counter()
                for i in range(each):
                    flight = flights[(i * 7 + len(rows)) % len(flights)]
                    rng = np.random.default_rng([seed, i, len(rows)])
                    bad, truth = (
                        injection.function(flight, rng, size, **case)
                        if size is not None
                        else injection.function(flight, rng, **case)
                    )
                    if kind == "copy":
                        same = len(find_copies([flight, bad])) == 1
                        hits, could, could_hits = hits + same, could + 1, could_hits + same
                        continue
                    verdict = audit(bad)
                    found = [f for f in verdict.faults if meets(f, truth)]
                    hits += bool(found)
                    minimum = found[0].minimum_detectable if found else float("nan")
                    stated.append(minimum)
                    if detectable(flight, bad, truth):
                        could, could_hits = could + 1, could_hits + bool(found)
                    other.update(f.kind for f in verdict.faults if f.kind not in (kind, "dead_stream", *INFORMATION))
                rows.append(
                    {
                        "kind": kind,
                        "case": {k: str(v) for k, v in case.items()},
                        "size": size,
                        "unit": injection.unit,
                        "found": hits,
                        "n": each,
                        "at_or_above_minimum": could,
                        "found_of_these": could_hits,
                        "stated_minimum": float(np.nanmedian(stated)) if np.isfinite(stated).any() else None,
                        "others": dict(other),
                    }
                )
                row = rows[-1]
                print(
                    f"{kind:17s} {row['case']!s:58s} size {size!s:6s} found {hits}/{each}, "
                    f"of detectable {interval(could_hits, could):22s} "
                    f"stated {row['stated_minimum']!s:.8s} others {row['others']}",
                    flush=True,
                )
    return rows


def run_offsets(flights: list[Flight], n: int, seed: int, label: str) -> dict:
    """Errors and coverage of the gyro's offset for n offsets in -100..100 ms put into ``flights`` in turn."""
    rng = np.random.default_rng([seed, 99])
    errors, inside, unknown = [], 0, 0
    for i in range(n):
        offset = float(rng.uniform(-0.1, 0.1))
        late, _ = INJECTIONS["clock_offset"].function(flights[i % len(flights)], rng, offset)
        reading = audit(late).clock["imu"]
        if not reading.identifiable or reading.ci95_s is None:
            unknown += 1
            continue
        errors.append(reading.offset_s - offset)
        inside += reading.ci95_s[0] <= offset <= reading.ci95_s[1]
    e = 1e3 * np.abs(errors)
    print(
        f"offsets {label}: n {len(e)}, not identifiable {unknown}, "
        f"median error {np.median(e):.2f} ms, p90 {np.quantile(e, 0.9):.2f}, "
        f"largest {e.max():.2f}, mean {1e3 * np.mean(errors):+.2f}; interval covers {interval(inside, len(e))}"
    )
    return {
        "label": label,
        "n": len(e),
        "unknown": unknown,
        "median_ms": float(np.median(e)),
        "p90_ms": float(np.quantile(e, 0.9)),
        "covered": inside,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in (("clean", 200), ("each", 8), ("offsets", 200), ("seed", 1)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    flights = practice_flights(options.clean, options.seed)
    result: dict[str, Any] = {"clean": run_clean(flights)[1]}
    if options.offsets:
        result["offsets"] = [run_offsets(flights, options.offsets, options.seed, "quiet clock")]
        wandering = practice_flights(min(options.clean, 40), options.seed + 1, chain=LoggingChain(wander_sd_s=0.033))
        result["offsets"].append(
            run_offsets(wandering, min(options.offsets, 80), options.seed, "clock wandering by 33 ms")
        )
    if options.each:
        result["power"] = run_power(flights, options.each, options.seed)
        total = sum(r["at_or_above_minimum"] for r in result["power"])
        print(
            "at or above the stated minimum: found",
            interval(sum(r["found_of_these"] for r in result["power"]), total),
        )
    if options.json:
        write_json(options.json, result)


if __name__ == "__main__":
    main()

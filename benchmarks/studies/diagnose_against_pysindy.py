"""The diagnosis against sparse regression (pysindy) on the same residual of the same blind cases: names and time.

    pip install -e ".[bench]"
    python benchmarks/studies/diagnose_against_pysindy.py [--cases 12] [--seed 77] [--json FILE]

SYNTHETIC cases of ``nanobench prove`` (kinds but faults of the data, which sparse regression does not look for). Both
get the same tracks after audit and re-timing, and the same vocabulary. A column of pysindy's library is the effect of
one parameter of one term on force and torque along the flights, scaled to RMS 1. The target is the residual of all six
channels, each in units of its spread. Of ``mass`` and ``thrust_scale``, which do the same, it is given one. Two ways:

    STLSQ           Threshold by flights held out in turn: the sparsest within one standard error of the best.
    best threshold  One threshold for all cases, with most of these very cases right. It flatters pysindy.

Sparse regression cannot report "unknown", nor that two terms are indistinguishable. Both are scored by the rules of
``nanobench prove``. There an identified effect is right when it is the concealed term or its declared twin. A
thrust map that pysindy identifies is taken for either map. Time is from tracks to
verdict for both; ours includes predictions of flights left out.
"""

import argparse
import math
import os
import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from identification.mismatch.diagnosis import diagnose
from identification.mismatch.fitting import slopes
from identification.mismatch.recordings import Recordings, look_over
from identification.mismatch.space import MAPS, space_around
from identification.mismatch.wrench import Wrench
from identification.prove.blind_proof import plan
from identification.prove.make import Case, make_cases
from identification.prove.score import CaseScore, score_case
from identification.prove.summary import Share
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.errors import how_to_install
from nanobench_tools.harness.clocks import on_clock
from nanobench_tools.physics import Model
from nanobench_tools.results.result_files import write_json

KINDS = ("null", "single", "twin", "pair", "foreign")
THRESHOLDS = (0.01, 0.02, 0.04, 0.08, 0.15, 0.3, 0.6, 1.2)
"""Of coefficients of columns of RMS 1, in units of the residual's spread."""
RIDGE = 1e-3
TWIN = "mass"
"""Left out of the library: thrust_scale does the same."""


def seen(case: Case) -> Recordings:
    audits = {flight.name: audit(flight) for flight in case.flights}
    moved = on_clock(case.flights, audits, "joint")
    return look_over(case.flights, audits, moved.flights, moved.audits, "thrust_voltage" in case.simulator)


def library(recordings: Recordings, simulator: Model) -> tuple[np.ndarray, np.ndarray, list[str], np.ndarray]:
    """Columns (rows, parameters) of RMS 1, residual (rows,), term of each column, flight of each row."""
    wrench, space = Wrench(recordings.tracks), space_around(simulator)
    asked = np.concatenate([space.free(t) for t in space.terms if t != TWIN])
    left, does = wrench.residual(space.model), slopes(wrench, space.model, asked)
    columns, wanted, flights = [], [], []
    for part, (values, effects) in enumerate(zip(left, does, strict=True)):
        for axis in range(3):
            spread = max(float(np.median(np.abs(values[:, axis] - np.median(values[:, axis])))) / 0.6745, 1e-9)
            wanted.append(values[:, axis] / spread)
            columns.append(effects[:, axis] / spread)
            flights.append(wrench.flight[(wrench.force_at, wrench.torque_at)[part]])
    theta, size = np.concatenate(columns), np.sqrt(np.mean(np.concatenate(columns) ** 2, axis=0))
    keep = size > 1e-9
    terms = [space.model.slots[i].term.name for i in asked[keep]]
    return theta[:, keep] / size[keep], np.concatenate(wanted), terms, np.concatenate(flights)


def regression(theta: np.ndarray, wanted: np.ndarray, threshold: float) -> np.ndarray:
    """Coefficients (parameters,) of pysindy's STLSQ; all zero where nothing passes."""
    import pysindy as ps

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that everything was eliminated is an answer
        found = ps.STLSQ(threshold=threshold, alpha=RIDGE * len(theta), max_iter=20).fit(theta, wanted[:, None])
    return np.ravel(found.coef_)


def threshold_of(theta: np.ndarray, wanted: np.ndarray, flights: np.ndarray) -> float:
    """The largest whose error on flights held out is within a standard error of the best; inf where no term helps."""
    numbers = np.unique(flights)
    errors = np.empty((len(numbers), len(THRESHOLDS) + 1))
    for row, number in enumerate(numbers):
        out = flights == number
        for k, threshold in enumerate(THRESHOLDS):
            errors[row, k] = np.mean((wanted[out] - theta[out] @ regression(theta[~out], wanted[~out], threshold)) ** 2)
        errors[row, -1] = np.mean(wanted[out] ** 2)
    mean = errors.mean(axis=0)
    best = int(np.argmin(mean))
    if len(numbers) == 1:
        return (*THRESHOLDS, float("inf"))[best]
    spread = (errors - errors[:, [best]]).std(axis=0, ddof=1) / np.sqrt(len(numbers))
    fine = [k for k in range(len(mean)) if mean[k] - mean[best] <= spread[k]]
    return (*THRESHOLDS, float("inf"))[max(fine)]


def by_pysindy(recordings: Recordings, simulator: Model) -> list[dict[str, Any]]:
    """Verdicts in the shape of ours: threshold by flights held out, then one for every threshold."""
    start = time.perf_counter()
    theta, wanted, terms, flights = library(recordings, simulator)
    built = time.perf_counter()
    found = [_verdict(theta, wanted, terms, threshold_of(theta, wanted, flights), start)]
    for threshold in THRESHOLDS:
        begun = time.perf_counter()
        found.append(_verdict(theta, wanted, terms, threshold, begun - (built - start)))
    return found


def _verdict(theta: np.ndarray, wanted: np.ndarray, terms: Sequence[str], threshold: float,
             start: float) -> dict[str, Any]:
    kept = regression(theta, wanted, threshold) != 0.0 if np.isfinite(threshold) else np.zeros(len(terms), bool)
    named = list(dict.fromkeys(t for t, k in zip(terms, kept, strict=True) if k))
    return {"outcome": "named" if named else "none", "findings": [
        {"term": t, "equivalent": list(MAPS) if t in MAPS else [], "confidence": 0.5, "parameters": {}}
        for t in named], "unknown": None,
        "data_faults": [], "power": {}, "improvement": None, "elapsed_s": time.perf_counter() - start}


def ours(recordings: Recordings, simulator: Model, seed: int) -> dict[str, Any]:
    return diagnose(recordings, simulator, seed=seed).to_json()


def row_of(name: str, cases: Sequence[CaseScore]) -> dict[str, Any]:
    return {"method": name, "n": len(cases), "right": Share.of(c.right for c in cases),
            "false_names": Share.of(c.false_name for c in cases),
            "effects_named": Share.of(e.named for c in cases for e in c.effects),
            "named_where_nothing_is": Share.of(bool(c.named) for c in cases if c.kind in ("null", "foreign")),
            "names_per_case": float(np.mean([len(c.named) for c in cases])),
            "median_s": float(np.median([c.elapsed_s for c in cases]))}


def said(entry: Share) -> str:
    low, high = entry.ci95 or (math.nan, math.nan)
    return f"{entry.right} of {entry.n} [{100 * low:.0f}, {100 * high:.0f} %]"


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=12)
    parser.add_argument("--seed", type=int, default=77)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(argv)
    try:
        import pysindy
    except ImportError:
        print(f"pysindy is not installed; {how_to_install('bench')}", file=sys.stderr)
        return 2
    scored: dict[str, list[CaseScore]] = {"nanobench diagnose": [], "pysindy STLSQ": []}
    fixed: list[list[CaseScore]] = [[] for _ in THRESHOLDS]
    for case in make_cases(plan(options.cases, options.seed, KINDS)):
        recordings = seen(case)
        verdicts = [ours(recordings, case.simulator, options.seed), *by_pysindy(recordings, case.simulator)]
        for cases, verdict in zip([*scored.values(), *fixed], verdicts, strict=True):
            cases.append(score_case(case.truth, verdict))
        last = [c[-1] for c in scored.values()]
        print(f"{case.name} {case.spec.kind:8} {', '.join(last[0].truth) or '-':28} " + " | ".join(
            f"{'right' if c.right else 'FALSE' if c.false_name else 'miss '} {c.elapsed_s:5.1f} s "
            f"{', '.join(c.named) or c.outcome}" for c in last), flush=True)
    best = max(range(len(fixed)), key=lambda k: sum(c.right for c in fixed[k]))
    scored[f"pysindy best threshold ({THRESHOLDS[best]:g})"] = fixed[best]
    rows = [row_of(name, cases) for name, cases in scored.items()]
    print(f"\nSYNTHETIC, {options.cases} cases, seed {options.seed}, pysindy {pysindy.__version__}, "
          f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; exact 95 % intervals")
    for row in rows:
        print(f"{row['method']:29} right {said(row['right'])}; cases with false effects {said(row['false_names'])}; "
              f"effects identified {said(row['effects_named'])}, in cases without one "
              f"{said(row['named_where_nothing_is'])}; a case: {row['names_per_case']:.1f} effects, "
              f"{row['median_s']:.1f} s (median)")
    if options.json:
        write_json(options.json, {"synthetic": True, "rows": rows, "cases": scored})
    return 0


if __name__ == "__main__":
    sys.exit(main())

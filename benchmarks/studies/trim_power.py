"""What a comparison of trims names, invents and covers, on trims that are drawn (SYNTHETIC).

    python benchmarks/studies/trim_power.py [--each 200] [--normal 5] [--seed 1] [--json FILE]

A vehicle differs from day to day by the spread that ``benchmarks/studies/trim_spread.py`` measures; a folder is three
flights of one day. The sizes of the changes are drawn; the changes are physics written again here, not the code of the
causes.
"""

import argparse
from collections import Counter
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from identification.mismatch.steady.causes import Body
from identification.mismatch.steady.comparison import compare, normal_flights
from identification.mismatch.steady.trim import Trim
from nanobench_tools.results.result_files import write_json

MOTORS = np.array([[1, -1], [-1, -1], [-1, 1], [1, 1]]) * 0.0325
BODY = Body(MOTORS, 0.034)
DAY, FLIGHT, LEVEL = 0.023, 0.004, 0.02
"""Spread of the ln thrust of a motor between days and between flights of one, and of the level [m/s^2]."""


def trims(rng: np.random.Generator, n: int, change: np.ndarray, same_day: bool) -> list[Trim]:
    own = {"gains": np.full(4, 0.003), "level": np.full(2, 0.01), "push": np.full(2, 0.01)}
    day, level = DAY * rng.standard_normal(4), LEVEL * rng.standard_normal(2)
    found = []
    for k in range(n):
        if not same_day:
            day, level = DAY * rng.standard_normal(4), LEVEL * rng.standard_normal(2)
        found.append(Trim(f"f{k}", change + day + FLIGHT * rng.standard_normal(4), level,
                          np.array([np.nan, 0.005 * rng.standard_normal()]), own, True, 3.6, 15.0, 0.5))
    return found


def loss(motors: tuple[int, ...], shares: tuple[float, ...]) -> np.ndarray:
    change = np.zeros(4)
    change[[m - 1 for m in motors]] = -np.log1p(-np.array(shares))
    return change


def load(mass_g: float, x_mm: float, y_mm: float) -> np.ndarray:
    """Force and moments about x, y and z, solved for the four thrusts."""
    balance = np.stack([np.ones(4), MOTORS[:, 1], MOTORS[:, 0], np.array([-1.0, 1.0, -1.0, 1.0])])
    weight, added = BODY.mass_kg * 9.81, mass_g * 9.81e-3
    asked = np.linalg.solve(balance, [weight + added, added * y_mm / 1e3, added * x_mm / 1e3, 0.0])
    return np.log(np.maximum(asked, 1e-3) / (weight / 4.0))


def draw(rng: np.random.Generator, kind: str) -> tuple[np.ndarray, str | None, dict[str, float]]:
    """(change, cause, sizes) of one folder of a kind."""
    if kind == "nothing":
        return np.zeros(4), None, {}
    if kind.startswith("one propeller"):
        low, high = (float(v) / 100.0 for v in kind.split()[2].split("-"))
        motor, share = int(rng.integers(1, 5)), float(rng.uniform(low, high))
        return loss((motor,), (share,)), "propeller", {f"loss_m{motor}": 100.0 * share}
    if kind.startswith("two"):
        first, second = sorted(rng.choice(4, 2, replace=False) + 1)
        shares = tuple(float(s) for s in rng.uniform(0.15, 0.25, 2))
        return loss((first, second), shares), "propeller", {f"loss_m{m}": 100.0 * s for m, s in
                                                            zip((first, second), shares, strict=True)}
    mass, x, y = float(rng.uniform(3.0, 6.0)), *(float(v) for v in rng.uniform(-30.0, 30.0, 2))
    return load(mass, x, y), "weight", {"mass": mass, "x": x, "y": y}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=200)
    parser.add_argument("--normal", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = []
    for kind in ("nothing", "one propeller 3-8 %", "one propeller 8-15 %", "one propeller 15-30 %", "two propellers",
                 "a weight of 3 to 6 g"):
        rng = np.random.default_rng([options.seed, len(kind)])
        said: Counter[str] = Counter()
        right, alone, false, covered = 0, 0, 0, []
        for _ in range(options.each):
            change, cause, sizes = draw(rng, kind)
            usual = normal_flights(trims(rng, options.normal, np.zeros(4), False), BODY)
            verdict = compare(trims(rng, 3, change, True), usual, BODY)
            finding = verdict["findings"][0] if verdict["findings"] else None
            said[" or ".join(finding["causes"]) if finding else verdict["outcome"]] += 1
            motors = {int(n[-1]) for n in sizes if n.startswith("loss")}
            member = next((m for m in (finding or {}).get("members", ()) if m["cause"] == cause), None)
            wrong = finding is not None and (member is None or (motors and not set(member["motors"]) <= motors))
            false += bool(wrong)
            right += finding is not None and not wrong
            alone += finding is not None and not wrong and len(finding["causes"]) == 1
            if member is not None:
                covered += [p["ci95"][0] <= sizes[n] <= p["ci95"][1] for n, p in member["dose"].items()
                            if n in sizes]
        rows.append({"kind": kind, "n": options.each, "named_right": right, "alone": alone, "false_names": false,
                     "outcomes": dict(said), "sizes": len(covered), "sizes_covered": sum(covered)})
        ends = binomtest(false, options.each).proportion_ci(0.95, method="exact")
        print(f"SYNTHETIC {kind}, n = {options.each}: " + ", ".join(f"{k} {v}" for k, v in said.most_common()) +
              f"; false names {false} (95 %: {100 * ends.low:.1f} to {100 * ends.high:.1f} %)" +
              (f"; intervals that hold the size {np.mean(covered):.0%} of {len(covered)}" if covered else ""))
    if options.json:
        everything = {key: sum(row[key] for row in rows) for key in ("n", "false_names", "sizes", "sizes_covered")}
        write_json(options.json, {"synthetic": True, "rows": rows, "all": {**everything, "normal": options.normal}})


if __name__ == "__main__":
    main()

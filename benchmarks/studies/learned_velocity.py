"""Fits the learned velocity of ``learned_velocity_ekf``, each trajectory type left out in turn.

python benchmarks/studies/learned_velocity.py [--data DIR] [--write]

Clean rows in flight, clock as recorded, motion capture as truth. Reports for each type the error of its flights by the
weights that did not see it, and by the accelerometer alone. With --write the weights go into the package.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from estimators.learned_velocity import EVERY, FADES_S, FILE, Weights, features, fitted
from nanobench_tools import so3
from nanobench_tools.flight import mask_of
from nanobench_tools.protocols import task3
from nanobench_tools.sources.labels import family_of
from nanobench_tools.steps.options import Options

STEADY_S, EVERY_ROWS = 2.0, 5
"""After take-off, and of 100 a second."""

Samples = tuple[np.ndarray, np.ndarray]


def samples(case: task3.Case) -> Samples:
    """Features (n, 2, F) and true body velocity x, y (n, 2) of one flight."""
    time_s, found = features(case.flight)
    mocap = case.flight["mocap"]
    good = np.isfinite(mocap["qx", "qy", "qz", "qw", "vx", "vy", "vz"]).all(axis=1)
    at, true_s = mocap["qx", "qy", "qz", "qw"][good], mocap.time_s[good]
    rows = np.flatnonzero(mask_of(case.spans, time_s) & (time_s > case.spans[0].start_s + STEADY_S)
                          & (time_s < true_s[-1]))[::EVERY_ROWS]
    velocity = np.stack([np.interp(time_s[rows], true_s, column) for column in mocap["vx", "vy", "vz"][good].T], axis=1)
    body = so3.rotate(so3.conjugate(so3.interpolate(true_s, at, time_s[rows])), velocity)
    return found[rows], body[:, :2]


def off(weights: Weights, flights: Sequence[Samples]) -> float:
    """RMS error [m/s] per axis, constants of a flight taken out."""
    error = [np.einsum("nkf,kf->nk", x - x.mean(axis=0), weights.by) - (y - y.mean(axis=0)) for x, y in flights]
    return float(np.sqrt(np.mean(np.concatenate(error) ** 2)))


def alone(x: np.ndarray) -> np.ndarray:
    """The accelerometer's features, the others nought."""
    left = np.zeros_like(x)
    left[:, :, : len(FADES_S)] = x[:, :, : len(FADES_S)]
    return left + 1e-9 * np.random.default_rng(0).normal(size=x.shape)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, action="append", default=[])
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    options = Options(data=tuple(given.data), quiet=True)
    flights = options.load()
    cases = task3.select(flights, options.audit(flights)[0], task3.BLACKOUT)
    known: dict[str, list[Samples]] = {}
    for case in cases:
        known.setdefault(family_of(case.flight), []).append(samples(case))
    sets = {EVERY: fitted([one for family in known.values() for one in family])}
    print("type, flights, RMS error of body velocity per axis [m/s] by weights that did not see the type. Then the "
          "same of the accelerometer alone, RMS velocity")
    for name, mine in sorted(known.items()):
        others = [one for family, found in known.items() if family != name for one in found]
        sets[name] = fitted(others)
        acc = fitted([(alone(x), y) for x, y in others])
        moves = float(np.sqrt(np.mean(np.concatenate([y - y.mean(axis=0) for _, y in mine]) ** 2)))
        print(f"{name:14} {len(mine):3d}  {off(sets[name], mine):.3f}  "
              f"{off(acc, [(alone(x), y) for x, y in mine]):.3f}  {moves:.3f}")
    if given.write:
        text = {"about": "weights of estimators/learned_velocity.py, fitted by benchmarks/studies/learned_velocity.py",
                "flights": len(cases), "left_out": {name: one.to_json() for name, one in sets.items()}}
        FILE.write_text(json.dumps(text, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()

"""Speed of a grey-box fit against the same fit with scipy and finite differences, in one run.

    python benchmarks/speed/fit_speed.py [--data DIR]

Both have the same training flights, windows, errors, robust cost, priors, bounds, scales and start. Both fit the full
model of ``nanobench sysid`` without nuisances of the flights. Each searches until it has converged. The peer is
scipy.optimize.least_squares (trf, 2-point derivatives) on the batched NumPy rollout of the same model. A second
comparison uses our compiled rollout, which is our code too. One thread each; compilation is in our time. The whole fit
of ``sysid`` with random effects of every flight is timed separately. Without recordings, practice flights (SYNTHETIC).
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from kept import show
from scipy.optimize import least_squares

from identification.greybox.fit import GreyBox
from identification.greybox.fit_windows import cases_of, cut, gather
from identification.greybox.ladder import FULL
from identification.greybox.ranges import held, priors
from identification.greybox.residuals import HORIZONS, errors
from identification.greybox.sensitivity import _tangent
from identification.greybox.solve import Problem, solve, usual_errors
from nanobench_tools.auditing.selection import distinct
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.fit_bounds import bounds
from nanobench_tools.physics.numeric import rollout as numpy_rollout
from nanobench_tools.physics.rollout import rollout
from nanobench_tools.practice.flights import write_practice
from nanobench_tools.sources.discover import default_data, load_recordings

REQUIRED_RATIO, REQUIRED_S = 20.0, 90.0
FLIGHTS = 15
EVERY = 3
"""The comparison takes every third window, or the peer would take minutes."""


def problem_of(data) -> Problem:
    """The full model on ``data``."""
    model = Model(Vehicle(), FULL)
    lower, upper = bounds(model)
    free = np.array([name not in held(model) for name in model.names])
    return Problem(model, data, free, np.where(free, lower, model.values), np.where(free, upper, model.values),
                   priors(model), share=0.4)


def peer(problem: Problem, scale: np.ndarray, fly) -> tuple[float, int, float]:
    """(seconds, rollouts, cost) of scipy; ``fly`` is the rollout it calls."""
    data, on = problem.data, np.flatnonzero(problem.free)
    matrix, target = problem.prior_rows()
    calls = 0

    def residuals(free: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        values = problem.model.values.copy()
        values[on] = free
        states = fly(problem.model, data.start, data.motor, data.battery_V, data.past, parameters=values)
        found, _ = errors(states[:, HORIZONS, :13].transpose(1, 2, 0), None, data.truth[:, HORIZONS - 1])
        length = np.linalg.norm(found, axis=-1) / scale
        robust = np.sqrt(2.0 * (np.sqrt(1.0 + length**2) - 1.0) * problem.share / scale.size)
        return np.concatenate([robust.ravel(), matrix @ values - target])

    before = time.perf_counter()
    found = least_squares(residuals, problem.model.values[on], bounds=(problem.lower[on], problem.upper[on]),
                          x_scale="jac", ftol=1e-5, max_nfev=200)
    return time.perf_counter() - before, calls, float(found.cost)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", type=Path, nargs="*")
    args = parser.parse_args()
    places = args.data or default_data()
    with tempfile.TemporaryDirectory() as folder:
        if not places:
            write_practice(Path(folder), FLIGHTS, 0)
            places = [Path(folder)]
        flights = distinct(load_recordings(list(places)).flights)[0]
    cases = cases_of([f for f in flights if "motor" in f][:2 * FLIGHTS])[:FLIGHTS]
    cuts = cut(cases)
    before = time.perf_counter()
    whole = GreyBox(FULL, adapt="inputs").fit_cuts(cuts).result_
    whole_s = time.perf_counter() - before
    data = gather(cuts)
    problem = problem_of(data.rows(slice(None, None, EVERY)))
    scale = usual_errors(problem, problem.model.values, np.zeros((len(data.names), 0)))
    _tangent.cache_clear()
    before = time.perf_counter()
    found = solve(problem, scale)
    ours = time.perf_counter() - before
    rows = [(name, fly, *peer(problem, scale, fly)) for name, fly in (("NumPy rollout", numpy_rollout),
                                                                      ("our compiled rollout", rollout))]
    word = "SYNTHETIC" if any(f.provenance.synthetic for f in flights) else "real"
    print(f"whole fit: {whole_s:.1f} s, {len(data)} windows of {len(cases)} {word} flights, a random effect "
          f"of each, {whole.steps} steps (required < {REQUIRED_S:.0f} s: {'yes' if whole_s < REQUIRED_S else 'NO'})")
    print(f"the same fit by both, {len(problem.data)} windows, {int(problem.free.sum())} parameters, fixed units:")
    print(f"  ours: {ours:.2f} s, {found.steps} steps, cost {found.cost:.3f}"
          f"{', ' + found.trouble if found.trouble else ''}")
    for name, fly, seconds, calls, cost in rows:
        print(f"  scipy least_squares, finite differences, {name}: {seconds:.1f} s, {calls} rollouts, cost {cost:.3f}: "
              f"ratio {seconds / ours:.1f}")
        show(f"scipy least_squares, {name} / ours", seconds / ours, len(problem.data),
             REQUIRED_RATIO if fly is numpy_rollout else None)


if __name__ == "__main__":
    main()

"""The least possible error on a path with corners, and that of one controller: the battery limits it, not the gains.

    python benchmarks/studies/tracking_bounds.py [--plants 4] [--seconds 8] [--speed 1.0] [--controller mpc_daqp]
                                                [--json FILE]

Each plant of the ensemble (SYNTHETIC) runs all motors at full command; that is its lift L. No vehicle accelerates
upward by more than L - g, downward by more than g, or sideways by more than sqrt(L^2 - g^2). Consider a point that
obeys these, knows the whole path, and tips and changes thrust at once: it has the least possible RMSE. It is a
quadratic program per axis, and no controller can have less. The flown RMSE is next to it.
"""

import argparse
import os
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import daqp
import numpy as np

from controllers.plants.ensemble import Ensemble, draw, shipped_simulator
from controllers.plants.simulated_flights import flown, made
from nanobench_tools.physics.simulator import loads
from nanobench_tools.protocols.simulated import TICK_S, Paths, score, specs_of
from nanobench_tools.results.result_files import write_json

EVERY = 2
"""Ticks a step of the program."""
BEFORE_S = 1.0
"""So long before it is scored the point may begin to move."""
GRAVITY_M_S2 = 9.81


def lift_m_s2(crowd: Ensemble) -> np.ndarray:
    """(n,) acceleration that all motors give a plant held level, its battery sagging under them."""
    plant = crowd.plant(np.zeros((len(crowd), 3)))
    full, steps = np.ones((len(crowd), 4)), round(0.3 / plant.step_s)
    speed = []
    for _ in range(steps):
        plant.advance(full)
        plant.state[6:13] = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])[:, None]
        speed.append(plant.state[5].copy())
    rows = round(0.1 / plant.step_s)
    return (speed[-1] - speed[-1 - rows]) / 0.1 + GRAVITY_M_S2


def least(goal: np.ndarray, speed: np.ndarray, first: int, low: float, high: float) -> np.ndarray:
    """Errors (m - first,) of the best point along one axis: goal (m,) every EVERY ticks, begun on it with its speed.
    Rows before ``first`` do not count."""
    dt, m = EVERY * TICK_S, len(goal)
    k = np.arange(m)
    reach = np.where(k[:, None] > k, (k[:, None] - k - 0.5) * dt * dt, 0.0)[:, :-1]
    away = goal[0] + speed[0] * dt * k - goal
    counted = reach[first:]
    scale = 1.0 / dt
    h = scale * scale * counted.T @ counted
    z, _, flag, _ = daqp.solve(h + 1e-9 * np.eye(m - 1), scale * counted.T @ away[first:], np.empty((0, m - 1)),
                               np.full(m - 1, high / scale), np.full(m - 1, low / scale), iter_limit=20000)
    if flag != 1:
        raise ArithmeticError(f"the program was not solved: {flag}")
    return away[first:] + scale * counted @ z


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plants", type=int, default=4)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--speed", type=float, default=1.0)
    parser.add_argument("--radio-delay-s", type=float, default=0.0)
    parser.add_argument("--controller", default="mpc_daqp")
    parser.add_argument("--trajectory", action="append", help="default: star and staircase_climb")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    specs = specs_of(given.trajectory or ["star", "staircase_climb"], [given.speed], given.seconds)
    paths, crowd = Paths(tuple(specs)), draw(shipped_simulator(), given.plants, given.seed, None, given.radio_delay_s)
    lift = lift_m_s2(crowd)
    controller = made(given.controller, loads(shipped_simulator()), given.radio_delay_s)
    found = score(flown(controller, paths, crowd), paths, len(crowd), controller.period_s)
    print(f"SYNTHETIC, n = {len(crowd)} plants, seed {given.seed}: lift over weight and RMSE [cm], least possible / "
          f"{given.controller}")
    rows = []
    for k, spec in enumerate(specs):
        counted = paths.scored(k)
        begin = counted.start - round(BEFORE_S / TICK_S)
        goal, speed = (paths.all[i][begin:counted.stop:EVERY, k] for i in (0, 1))
        plants = []
        for i, most in enumerate(lift):
            level = float(np.sqrt(max(most**2 - GRAVITY_M_S2**2, 0.0)))
            ends = ((-level, level), (-level, level), (-GRAVITY_M_S2, max(float(most) - GRAVITY_M_S2, 0.0)))
            first = round(BEFORE_S / TICK_S) // EVERY
            gaps = [least(goal[:, axis], speed[:, axis], first, *ends[axis]) for axis in range(3)]
            best = float(np.sqrt(np.mean(np.sum(np.square(gaps), axis=0))))
            plants.append({"lift_over_weight": most / GRAVITY_M_S2, "least_m": best, "flown_m": found[k][i]["rmse_m"]})
        rows.append({"path": spec.family, "plants": plants})
        print(f"{spec.family} {given.speed} m/s   " + "   ".join(
            f"{p['lift_over_weight']:.3f}: {100 * p['least_m']:.1f} / {100 * p['flown_m']:.1f}" for p in plants),
            flush=True)
    if given.json:
        write_json(given.json, {"synthetic": True, "n": len(crowd), "seconds": given.seconds, "speed_m_s": given.speed,
                                "rows": rows})


if __name__ == "__main__":
    main()

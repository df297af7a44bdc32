"""Every registered controller on SYNTHETIC practice vehicles: how far from the path, family by family.

    python benchmarks/controllers_fly.py [--seconds 12] [--seed 0] [--controller NAME ...]

All recorded families, slow, medium and fast; the vehicles, their onboard estimate, noise and battery are those of the
practice flights, the same for every controller. RMSE [m] of the true position over the path without its first
SETTLED_S, in which the vehicle flies from the hover to where the path begins. The vehicle is a model: this ranks
controllers on it and says nothing of how it agrees with the real one.
"""

from __future__ import annotations

import argparse

import numpy as np

from nanobench_tools import registry
from nanobench_tools.practice.flying import TICK_S, Flown, fly
from nanobench_tools.practice.references import RECORDED, PathSpec, path_spec
from nanobench_tools.practice.timeline import PATH

SPEEDS = ("slow", "medium", "fast")
SETTLED_S = 3.0
FULL = 0.999


def rmse_m(flown: Flown, spec: PathSpec, row: int) -> float:
    """Of flight ``row`` over its settled path."""
    ticks = np.flatnonzero(flown.timeline.phase[:, row] == PATH)[round(SETTLED_S / TICK_S):]
    asked = spec.at(flown.time_s[ticks] - flown.timeline.events[row].path_start_s).position_m
    return float(np.sqrt(np.mean(np.sum((flown.truth["position_m"][ticks, row] - asked) ** 2, axis=1))))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=12.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--controller", action="append", choices=registry.names("controllers"))
    given = parser.parse_args()
    specs = [path_spec(family, speed, duration_s=given.seconds) for family in RECORDED for speed in SPEEDS]
    print(f"SYNTHETIC, n = {len(specs)} flights a controller, RMSE [m] after {SETTLED_S:g} s")
    print(f"{'controller':18}{'told':9}" + "".join(f"{family[:9]:>10}" for family in RECORDED)
          + f"{'median':>10}{'90 %':>8}{'at cap %':>10}{'replaced':>10}")
    for name in given.controller or registry.names("controllers"):
        controller = registry.load("controllers", name)()
        flown = fly(controller, specs, seed=given.seed)
        errors = np.array([rmse_m(flown, spec, row) for row, spec in enumerate(specs)])
        by_family = np.median(errors.reshape(len(RECORDED), len(SPEEDS)), axis=1)
        full = 100.0 * float(np.mean(flown.truth["motor"].max(axis=2) > FULL))
        guard = getattr(controller, "guard", None)
        replaced = sum(guard.counts.values()) if guard else "-"
        print(f"{name:18}{controller.information:9}" + "".join(f"{e:10.3f}" for e in by_family)
              + f"{np.median(errors):10.3f}{np.quantile(errors, 0.9):8.3f}{full:10.2f}{replaced:>10}", flush=True)


if __name__ == "__main__":
    main()

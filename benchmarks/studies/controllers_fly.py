"""Every registered controller on SYNTHETIC practice vehicles: how far from the path, family by family.

    python benchmarks/studies/controllers_fly.py [--seconds 12] [--seed 0] [--controller NAME ...] [--delay 0.03]
                                                 [--charge 0.1]

All recorded families, slow, medium and fast; the vehicles, their onboard estimate, noise and battery are those of the
practice flights, the same for every controller. RMSE [m] of the true position over the path without its first
SETTLED_S, in which the vehicle flies from the hover to where the path begins. ``--delay``: commands reach the motors so
late; predictive controllers are told. ``--charge``: share of the cell's charge left at the start. The vehicle is a
model: this ranks controllers on it and says nothing of how it agrees with the real one.
"""

from __future__ import annotations

import argparse
from collections import deque

import numpy as np

from controllers.mpc_base import Mpc
from controllers.mpc_model import practice_model
from nanobench_tools import registry
from nanobench_tools.methods import Controller, Reference, VehicleState
from nanobench_tools.practice.flying import TICK_S, Flown, flight_rngs, fly
from nanobench_tools.practice.references import RECORDED, PathSpec, path_spec
from nanobench_tools.practice.timeline import PATH
from nanobench_tools.practice.vehicle_parameters import draw_vehicles

SPEEDS = ("slow", "medium", "fast")
SETTLED_S = 3.0
FULL = 0.999


class Late:
    """A controller whose commands reach the motors ``delay_s`` later (whole periods)."""

    def __init__(self, controller: Controller, delay_s: float) -> None:
        self.inner, self.name = controller, controller.name
        self.information, self.period_s = controller.information, controller.period_s
        self.periods = round(delay_s / controller.period_s)

    def reset(self, n: int) -> None:
        self.inner.reset(n)
        self._waiting = deque(np.zeros((n, 4)) for _ in range(self.periods))

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        self._waiting.append(self.inner.command(time_s, state, reference))
        return self._waiting.popleft()


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
    parser.add_argument("--delay", type=float, default=0.0, help="s from the command to the motors")
    parser.add_argument("--charge", type=float, help="of the cell at the start, 0 to 1")
    given = parser.parse_args()
    specs = [path_spec(family, speed, duration_s=given.seconds) for family in RECORDED for speed in SPEEDS]
    print(f"SYNTHETIC, n = {len(specs)} flights a controller, RMSE [m] after {SETTLED_S:g} s")
    print(f"{'controller':18}{'told':9}" + "".join(f"{family[:9]:>10}" for family in RECORDED)
          + f"{'median':>10}{'90 %':>8}{'worst':>8}{'at cap %':>10}{'replaced':>10}")
    for name in given.controller or registry.names("controllers"):
        kind = registry.load("controllers", name)
        controller = kind(practice_model(), delay_s=given.delay) if issubclass(kind, Mpc) else kind()
        vehicles = None
        if given.charge is not None:
            rngs = [flight_rngs(given.seed, i, 6)[1] for i in range(len(specs))]
            vehicles = draw_vehicles(rngs, charge_at_start=given.charge)
        flown = fly(Late(controller, given.delay), specs, vehicles, seed=given.seed)
        errors = np.array([rmse_m(flown, spec, row) for row, spec in enumerate(specs)])
        by_family = np.median(errors.reshape(len(RECORDED), len(SPEEDS)), axis=1)
        full = 100.0 * float(np.mean(flown.truth["motor"].max(axis=2) > FULL))
        guard = getattr(controller, "guard", None)
        replaced = sum(guard.counts.values()) if guard else "-"
        print(f"{name:18}{controller.information:9}" + "".join(f"{e:10.3f}" for e in by_family)
              + f"{np.median(errors):10.3f}{np.quantile(errors, 0.9):8.3f}{errors.max():8.3f}"
              + f"{full:10.2f}{replaced:>10}", flush=True)


if __name__ == "__main__":
    main()

"""Practice flights as recordings: the input of ``nanobench run`` without recordings, and of the tests."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..flight import Flight, Provenance
from ..methods import Controller
from ..sources.nanobench import write_nanobench
from .flying import Flown, flight_rngs, fly
from .logging_chain import LoggingChain, record
from .onboard_crowd import CONTROLLERS, OnboardFleet
from .references import RECORDED, PathSpec, path_spec

EPOCH_S = 1_700_000_000.0
"""Unix time of flight 0; flights of one seed follow each other at MINUTES_APART."""
SECONDS_APART = 120.0
SEED_SECONDS = 10_000_000.0
"""Flights of different seeds lie on different days, so that no two sheets claim the same time."""
SPEEDS = ("slow", "medium", "fast")
BATCH = 200
"""Vehicles flown at once: keeps memory of a run near 1 GB."""
MELLINGER_SHARE = 23 / 79
"""Share of the published flights that flew this controller."""


def practice_flight(seed: int, family: str = "circle", speed: str = "medium", *, speed_m_s: float | None = None,
                    controller: str | Controller = "pid", chain: LoggingChain | None = None, spread: float = 1.0,
                    index: int = 0, **params: Any) -> Flight:
    """One practice flight; ``params`` are those of the family's sheet (radius_m, duration_s ...).

    ``controller`` is ``pid``, ``mellinger`` or any object behind the Controller Protocol. The same arguments give
    bit-identical flights. Raises UsageError for unknown names.
    """
    spec = path_spec(family, speed, speed_m_s=speed_m_s, **params)
    name = controller if isinstance(controller, str) else controller.name
    own = None if isinstance(controller, str) else controller
    return _fly_all([(index, spec, name)], seed, chain or LoggingChain(), spread, own)[0]


def practice_flights(n: int, seed: int = 0, *, families: Sequence[str] | None = None, chain: LoggingChain | None = None,
                     controllers: Sequence[str] = ("pid", "mellinger"), controller: Controller | None = None,
                     speeds: Sequence[str] = SPEEDS, duration_s: float | None = None, spread: float = 1.0,
                     progress: Callable[[int, int], None] | None = None) -> list[Flight]:
    """n practice flights: all recorded families and speeds in turn, about a third behind the Mellinger controller.

    Flight i depends on ``seed`` and i alone. A ``controller`` object flies all of them instead. ``duration_s`` shortens
    every path. ``progress(done, n)`` is called after every batch.
    """
    families = tuple(families or RECORDED)
    plan = []
    for i in range(n):
        rng = np.random.default_rng([seed, i, 77])
        family = families[i % len(families)]
        speed = speeds[(i // len(families)) % len(speeds)]
        which = controllers[0] if len(controllers) == 1 or rng.uniform() > MELLINGER_SHARE else controllers[1]
        params = {} if duration_s is None else {"duration_s": duration_s}
        plan.append((i, path_spec(family, speed, **params), which if controller is None else controller.name))
    return _fly_all(plan, seed, chain or LoggingChain(), spread, controller, progress)


def _fly_all(plan: list[tuple[int, PathSpec, str]], seed: int, chain: LoggingChain, spread: float,
             controller: Controller | None = None, progress: Callable[[int, int], None] | None = None) -> list[Flight]:
    """Plan of (number, path, controller) -> flights in its order. Long and short paths fly in separate batches."""
    flights: dict[int, Flight] = {}
    order = sorted(plan, key=lambda p: (-p[1].duration_s, p[0]))
    for start in range(0, len(order), BATCH):
        numbers, specs, names = zip(*order[start:start + BATCH], strict=True)
        flown = fly(controller or OnboardFleet(names), specs, seed=seed, indices=numbers, spread=spread)
        for row, (i, spec, name) in enumerate(zip(numbers, specs, names, strict=True)):
            flights[i] = _recording(flown, row, i, spec, name, seed, chain)
        if progress:
            progress(len(flights), len(plan))
    return [flights[i] for i, _, _ in plan]


def _recording(flown: Flown, row: int, index: int, spec: PathSpec, controller: str, seed: int,
               chain: LoggingChain) -> Flight:
    rngs = flight_rngs(seed, index, 9)[6:]
    recorded = record(flown, row, chain, rngs)
    name = f"practice_{spec.trajectory_id}_s{seed}_{index:03d}"
    battery = recorded.streams["battery"]["vbat"]
    metadata = {
        "trajectory_type": spec.family, "trajectory_id": spec.trajectory_id, "category": "practice", "repetition": 1,
        "crazyflie_id": "simulated", "firmware_version": "simulated", "params": dict(spec.params),
        "battery_voltage_start": float(battery[0]), "battery_voltage_end": float(battery[-1]), "synthetic": True,
        "practice": {"seed": seed, "index": index, "controller": controller, "clock_offset_s": chain.offset_s,
                     "clock_drift": chain.drift, "clock_wander_sd_s": chain.wander_sd_s,
                     "tail_s": float(recorded.tail_s), "tilt_rad": [float(x) for x in recorded.tilt_rad]},
        **({} if controller in CONTROLLERS else {"controller": str(controller)}),
        "family": spec.family, "speed": spec.speed if spec.has_speeds else None,
        "reference_speed_m_s": float(spec.params["speed_mps"]) if "speed_mps" in spec.params else None,
        "duration_s": spec.duration_s,
    }
    epoch = EPOCH_S + SEED_SECONDS * (seed % 100) + SECONDS_APART * index + 0.5
    provenance = Provenance(f"{name}.csv", "", "practice", synthetic=True)
    return Flight(name, recorded.streams, metadata, provenance, epoch_s=epoch)


def write_practice(out_dir: Path | str, n: int, seed: int = 0, *, suffix: str = ".csv", **options: Any) -> list[Path]:
    """Writes n practice flights as NanoBench CSV and sheet into ``out_dir``; ``options`` go to ``practice_flights``."""
    return [write_nanobench(flight, Path(out_dir) / f"{flight.name}{suffix}")
            for flight in practice_flights(n, seed, **options)]

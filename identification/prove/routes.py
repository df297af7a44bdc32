"""Flights in which effects show: what an effect wants -> paths, speeds, headings, heights, charges."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from nanobench_tools.practice.references import PathSpec, path_spec

from .case_kinds import FlightSpec

MOST, FEWEST = 6, 4
DURATION_S = (12.0, 22.0)
"""Of the path; take-off, hover, landing and standing take another 11 s."""
CHARGE = (0.72, 0.98)


def _round(x: float) -> float:
    return float(f"{x:.3g}")


def _duration(rng: np.random.Generator) -> float:
    return float(round(rng.uniform(*DURATION_S), 1))


def lateral(rng: np.random.Generator, speed: tuple[float, float] = (0.6, 1.05)) -> PathSpec:
    """A curve at one height; the PID's position loop asks for at most 1.1 m/s."""
    family = ("figure_eight", "circle", "oval", "lissajous", "star")[int(rng.integers(5))]
    size = {"figure_eight": "scale_m", "circle": "radius_m", "star": "radius_m"}.get(family)
    params = {"altitude_m": _round(rng.uniform(0.8, 1.2)), "duration_s": _duration(rng)}
    if size:
        params[size] = _round(rng.uniform(0.7, 1.0))
    return path_spec(family, "medium", speed_m_s=_round(rng.uniform(*speed)), **params)


def vertical(rng: np.random.Generator) -> PathSpec:
    """Trefoil that climbs and sinks by up to 0.35 m at 2 rad/s."""
    return path_spec("trefoil", "medium", speed_m_s=_round(rng.uniform(0.65, 0.9)), scale_m=0.8, altitude_m=1.0,
                     z_amplitude_m=_round(rng.uniform(0.25, 0.35)), duration_s=_duration(rng))


def low(rng: np.random.Generator) -> PathSpec:
    """Between 0.15 and 0.5 m above the ground, at one height or up and down."""
    if rng.uniform() < 0.4:
        return path_spec("circle", "slow", speed_m_s=_round(rng.uniform(0.4, 0.6)), radius_m=0.8,
                         altitude_m=_round(rng.uniform(0.20, 0.24)), duration_s=_duration(rng))
    return path_spec("trefoil", "medium", speed_m_s=_round(rng.uniform(0.45, 0.6)), scale_m=0.8,
                     altitude_m=_round(rng.uniform(0.28, 0.32)), z_amplitude_m=0.12, duration_s=_duration(rng))


def turning(rng: np.random.Generator) -> PathSpec:
    """A curve with the heading going to and fro by up to 150 deg."""
    return replace(lateral(rng), turn=(_round(np.radians(rng.uniform(80.0, 150.0))), _round(rng.uniform(8.0, 14.0))))


def spinning(rng: np.random.Generator) -> PathSpec:
    """The heading goes to and fro fast, up to 2 rad/s."""
    return replace(lateral(rng), turn=(_round(np.radians(rng.uniform(40.0, 60.0))), _round(rng.uniform(2.5, 3.5))))


def fast(rng: np.random.Generator) -> PathSpec:
    """1.1 to 1.6 m/s with tilts of 10 to 20 deg; for the Mellinger controller."""
    family = ("figure_eight", "circle")[int(rng.integers(2))]
    size = {"figure_eight": {"scale_m": 1.2}, "circle": {"radius_m": 1.0}}[family]
    return path_spec(family, "fast", speed_m_s=_round(rng.uniform(1.1, 1.6)), duration_s=_duration(rng), **size)


def slow(rng: np.random.Generator) -> PathSpec:
    """0.25 to 0.45 m/s."""
    return lateral(rng, (0.25, 0.45))


WANTS: dict[str, tuple[Callable[[np.random.Generator], PathSpec], str]] = {
    "lateral": (lateral, "pid"), "vertical": (vertical, "pid"), "low": (low, "pid"), "turning": (turning, "pid"),
    "spinning": (spinning, "pid"), "fast": (fast, "mellinger"), "slow": (slow, "pid")}
"""What an effect may want of flights, and who flies it; ``charges`` and ``full`` say something of the batteries."""
ALWAYS = ("lateral", "vertical", "turning", "fast")
"""What a case flies when nothing is wanted."""


def draw_flights(rng: np.random.Generator, wants: Sequence[str] = (), *, count: int | None = None,
                 charges: tuple[float, float] = CHARGE) -> tuple[FlightSpec, ...]:
    """4 to 6 flights: two of each of the first wanted kinds, then what every case flies.

    With ``charges`` wanted the batteries of the flights are spread evenly over the range, in random order.
    """
    count = count or int(rng.integers(FEWEST, MOST + 1))
    kinds = [w for w in wants if w in WANTS]
    order = [*kinds, *kinds[:2], *ALWAYS] if kinds else [*ALWAYS, *ALWAYS]
    chosen = [order[i % len(order)] for i in range(count)]
    low_charge, high = (0.9, 1.0) if "full" in wants else charges
    levels = np.linspace(low_charge, high, count) if "charges" in wants else rng.uniform(low_charge, high, count)
    levels = rng.permutation(levels)
    rng.shuffle(chosen)
    flights = []
    for name, level in zip(chosen, levels, strict=True):
        make, controller = WANTS[name]
        flights.append(FlightSpec(make(rng), controller, float(round(level, 3))))
    return tuple(flights)

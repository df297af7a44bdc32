"""The smallest swing that the flights would have shown: detection limit of a load on a string.

Swings of every size are added to the measured residual (``periodic.Swing``). Their frequencies cover the band, also
half a step off the examined frequencies, and their phases are random. The limit is the size from which FOUND of the
phases are detected, by the same rules as a real swing: ``periodic.swing_of``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import f as fisher

from nanobench_tools.physics.pendulum import lengths_m
from nanobench_tools.settings import number
from nanobench_tools.units import GRAVITY_M_S2

from .periodic import BESIDE, HALF, RISK, Swing, freedom_of, frequencies, tries, usual_level

FOUND = number("mismatch.smallest_swing.found")
SIZES_M_S2 = np.geomspace(0.005, 5.0, 70)
PHASES = 64
LEAN_DEG = number("mismatch.smallest_swing.lean_deg")


def smallest_swing(here: Sequence[Swing], normal: Sequence[Swing], mass_kg: float) -> dict[str, Any]:
    """{minimum_detectable, unit, axes, band_hz, string_m, force_N, load_g, by_hz, share_found}.

    ``minimum_detectable``: amplitude [m/s^2] along an observed axis, the largest over the band; None without a limit,
    and ``why`` gives the reason. ``force_N``: on a vehicle of this mass. ``load_g``: the load that pulls so at
    LEAN_DEG. ``by_hz``: [frequency, amplitude].
    """
    mine, usual = [s for s in here if s.runs], [s for s in normal if s.runs]
    nothing = {"minimum_detectable": None, "unit": "m/s^2"}
    if not normal:
        return {**nothing, "why": "it is detected by comparison with normal flights, and none were given"}
    if not mine or not usual:
        whose = "these flights" if not mine else "normal flights"
        return {**nothing, "why": f"{whose} show no velocity, tilt and yaw together for long enough"}
    usual_power, power = usual_level(usual), np.array([s.power for s in mine])
    seen = np.flatnonzero(np.isfinite(power).all(axis=(0, 1)) & np.isfinite(usual_power).all(axis=0))
    if not len(seen):
        return {**nothing, "why": "flights and normal flights do not show the same axis"}
    least = fisher.isf(RISK / tries(usual_power), *freedom_of(mine, usual))
    hertz = frequencies()
    band = np.arange(BESIDE, len(hertz) - BESIDE)
    sizes = np.array([[_smallest(power[:, :, a], usual_power[:, a], np.array([s.unit[a] for s in mine]),
                                 np.array([s.run_s for s in mine]), int(k), least) for a in seen] for k in band])
    worst = sizes.max(axis=1)
    if not np.isfinite(worst).any():
        return {**nothing, "why": f"not even a swing of {SIZES_M_S2[-1]:g} m/s^2 would be detected"}
    good = np.isfinite(worst)
    low, high = hertz[band[good]][[0, -1]]
    size = float(worst[good].max())
    return {"minimum_detectable": size, "unit": "m/s^2", "axes": [("forward", "left")[a] for a in seen],
            "band_hz": [float(low), float(high)], "string_m": [lengths_m(high, 0.0)[0], lengths_m(low, 0.0)[0]],
            "force_N": size * mass_kg,
            "load_g": 1e3 * size * mass_kg / (GRAVITY_M_S2 * math.sin(math.radians(LEAN_DEG))),
            "by_hz": [[float(f), float(w)] for f, w in zip(hertz[band[good]], worst[good], strict=True)],
            "share_found": FOUND}


def _smallest(power: np.ndarray, usual: np.ndarray, unit: np.ndarray, run_s: np.ndarray, k: int,
              least: float) -> float:
    """Smallest detected amplitude of a swing at frequency k of one axis; nan without one. ``power`` (flights, F) and
    usual (F,) of this axis; unit and run_s (flights,)."""
    rng = np.random.default_rng(k)
    phase = np.exp(2j * np.pi * rng.random((PHASES, len(power))))
    step = float(frequencies()[1] - frequencies()[0])

    def with_swing(at: int, away_hz: float) -> np.ndarray:
        """(sizes, phases, flights)"""
        height = np.sqrt(unit) * _window(away_hz * run_s)
        return np.asarray(np.abs(np.sqrt(power[:, at]) + SIZES_M_S2[:, None, None] * height * phase) ** 2)

    top = with_swing(k, 0.5 * step)
    ratio = top.mean(axis=2) / usual[k]
    found = (ratio > least) & (top > usual[k]).all(axis=2)
    for side in (-BESIDE, BESIDE):
        found &= with_swing(k + side, (BESIDE - 0.5) * step).mean(axis=2) / usual[k + side] < HALF * ratio
    enough = found.mean(axis=1) >= FOUND
    if not enough[-1]:
        return math.nan
    return float(SIZES_M_S2[len(enough) - int(np.argmin(enough[::-1])) if not enough.all() else 0])


def _window(bins: np.ndarray) -> np.ndarray:
    """Response of a Hann window to an amplitude so many bins away (Harris 1978, Proc. IEEE 66)."""
    x = np.asarray(bins, float)
    pole = np.isclose(np.abs(x), 1.0)
    return np.where(pole, 0.5, np.sinc(x) / np.where(pole, 1.0, 1.0 - x**2))


def say(swing: Mapping[str, Any] | None) -> str:
    """A sentence on the smallest swing; empty if it was not computed."""
    if not swing:
        return ""
    if swing["minimum_detectable"] is None:
        return f"A swing, as of a load on a string, cannot be detected: {swing['why']}."
    seen = {"forward": "ahead and back", "left": "to the left and right"}
    low, high = swing["band_hz"]
    short, long = swing["string_m"]
    return (f"A load on a string would be detected from a swing of {swing['minimum_detectable']:.2f} m/s^2 "
            f"{' or '.join(seen[a] for a in swing['axes'])} on. That is a force of {1e3 * swing['force_N']:.1f} mN, as "
            f"of {swing['load_g']:.1f} g at {LEAN_DEG:.0f} degrees. Frequencies checked: {low:.1f} to {high:.1f} Hz "
            f"(strings of {short:.2f} to {long:.2f} m).")

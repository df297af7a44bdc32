"""A horizontal force that comes and goes: detects a load that swings below a vehicle.

A swing pulls the vehicle sideways without a matching tilt. The horizontal acceleration, less the share of the tilt and
drag, is examined between LOWEST and HIGHEST. This covers a load on a string of 0.1 to 2.8 m. Its spectrum is compared
with that of the normal flights at the same frequency, since structure in every flight is the controller. The largest
ratio counts, tested against the F distribution with one trial per frequency.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import savgol_filter
from scipy.stats import f as fisher

from nanobench_tools.flight import Span
from nanobench_tools.settings import count, number
from nanobench_tools.units import GRAVITY_M_S2

from .reconstruct import ORDER, SMOOTH_ROWS, States

LOWEST_HZ = number("mismatch.periodic.lowest_hz")
HIGHEST_HZ = number("mismatch.periodic.highest_hz")
BROAD_HZ = number("mismatch.periodic.broad_hz")
DRAG_1_S = number("mismatch.periodic.drag_1_s")
FREQUENCIES = count("mismatch.periodic.frequencies")
NEIGHBOURS = count("mismatch.periodic.neighbours")
BINS = count("mismatch.periodic.bins")
RESOLUTION_HZ = number("mismatch.periodic.resolution_hz")
BESIDE = count("mismatch.periodic.beside")
HALF = number("mismatch.periodic.half")
RISK = number("mismatch.periodic.risk")
LEAST_S = number("mismatch.periodic.least_s")


@dataclass(frozen=True)
class Swing:
    """Spectrum of one flight.

    ``power`` (FREQUENCIES, 2): residual forward and left over its level outside the mode. ``runs``: number of runs
    averaged. ``moments`` (FREQUENCIES, 3): of the residual, forward^2, left^2 and their product, (m/s^2)^2 s. nan
    without tilt.
    """

    power: np.ndarray
    runs: int
    moments: np.ndarray
    unit: np.ndarray
    """(2,) power that a swing of 1 m/s^2 would have."""
    run_s: float
    """Mean length of the runs."""

    def to_json(self) -> dict[str, Any]:
        return {"power": self.power.tolist(), "runs": self.runs, "moments": self.moments.tolist(),
                "unit": self.unit.tolist(), "run_s": self.run_s}

    @classmethod
    def from_json(cls, body: dict[str, Any]) -> Swing:
        power, moments = (np.array([[np.nan if v is None else v for v in row] for row in body[name]], float)
                          for name in ("power", "moments"))
        unit = np.array([np.nan if v is None else v for v in body["unit"]], float)
        return cls(power, body["runs"], moments, unit, body["run_s"])


def frequencies() -> np.ndarray:
    return np.linspace(LOWEST_HZ, HIGHEST_HZ, FREQUENCIES)


def swing_in(states: States, runs: Sequence[Span]) -> Swing:
    """Spectrum of one flight's horizontal acceleration, without the part that the tilt explains."""
    unknown = Swing(np.full((FREQUENCIES, 2), np.nan), 0, np.full((FREQUENCIES, 3), np.nan), np.full(2, np.nan), 0.0)
    total, moments, count = np.zeros((FREQUENCIES, 2)), np.zeros((FREQUENCIES, 3)), 0
    unit, seconds = np.zeros(2), 0.0
    tilts = (states.pitch_rad, None if states.roll_rad is None else -states.roll_rad)
    if states.acceleration_m_s2 is None or states.yaw_rad is None or all(t is None for t in tilts):
        return unknown
    push = states.heading(states.acceleration_m_s2)
    speed = np.zeros_like(push) if states.velocity_m_s is None else states.heading(states.velocity_m_s)
    for run in runs:
        rows = np.flatnonzero(run.mask(states.time_s))
        if run.duration_s < LEAST_S or len(rows) < 4 * SMOOTH_ROWS:
            continue
        found = [(np.full(FREQUENCIES, np.nan + 0j), np.nan, np.nan) if tilt is None else
                 _peaks(push[:, k], tilt, speed[:, k], rows, states) for k, tilt in enumerate(tilts)]
        total += np.stack([np.abs(wave) ** 2 / level for wave, level, _ in found], axis=1)
        unit += [gain / level for _, level, gain in found]
        (ahead, *_), (aside, *_) = found
        moments += np.stack([np.abs(ahead) ** 2, np.abs(aside) ** 2, (ahead * aside.conj()).real], axis=1)
        seconds += run.duration_s
        count += 1
    return Swing(total / count, count, moments / count, unit / count, seconds / count) if count else unknown


def _peaks(push: np.ndarray, tilt: np.ndarray, speed: np.ndarray, rows: np.ndarray,
           states: States) -> tuple[np.ndarray, float, float]:
    """(FREQUENCIES,) complex amplitudes of the residual of one axis and run, and two reference levels.

    These are the mean of the squared amplitudes up to BROAD_HZ, and the square for a swing of 1 m/s^2. The tilt's share
    is not fitted: the controller answers a swing with tilt, and a fit would confuse the two.
    """
    t = states.time_s
    step = max(float(np.median(np.diff(t))), 1e-4)
    asked = np.cumsum(GRAVITY_M_S2 * np.where(np.isfinite(tilt), tilt, 0.0) - DRAG_1_S * speed) * step
    left = (push - savgol_filter(asked, SMOOTH_ROWS, ORDER, deriv=1, delta=step))[rows]
    t = t[rows]
    trend = np.column_stack([np.ones(len(t)), t])
    left = left - trend @ np.linalg.lstsq(trend, left, rcond=None)[0]
    window = np.hanning(len(rows))
    window /= np.sqrt((window**2).sum())

    def wave(at_hz: np.ndarray) -> np.ndarray:
        return np.asarray(np.exp(-2j * np.pi * np.outer(at_hz, t)) @ (window * left))

    broad = np.abs(wave(np.arange(LOWEST_HZ, BROAD_HZ, 1.0 / (t[-1] - t[0])))) ** 2
    return wave(frequencies()), max(float(np.median(broad) / np.log(2.0)), 1e-30), float(window.sum()) ** 2 / 4.0


def swing_of(here: Sequence[Swing], normal: Sequence[Swing]) -> dict[str, Any] | None:
    """{frequency_hz, direction_deg, axes, ratio, p} of a swing that the flights ``here`` share and the normal ones
    lack.

    direction_deg: of the line it swings along, from ahead to the left, within 90 degrees either way; None if only one
    of the two axes, ``axes``, is observed.
    """
    mine, usual = [s for s in here if s.runs], [s for s in normal if s.runs]
    if not mine or not usual:
        return None
    tops, usual_power = np.array([s.power for s in mine]), usual_level(usual)
    ratio = tops.mean(axis=0) / usual_power
    ratio = np.where(_peaked(ratio), ratio, np.nan)
    if np.isnan(ratio).all():
        return None
    k, axis = np.unravel_index(int(np.nanargmax(ratio)), ratio.shape)
    p = min(1.0, tries(usual_power) * float(fisher.sf(ratio[k, axis], *freedom_of(mine, usual))))
    if p > RISK or not (tops[:, k, axis] > usual_power[k, axis]).all():
        return None
    ahead, aside, both = np.mean([m.moments for m in mine], axis=0)[k]
    axes = [name for name, seen in (("forward", ahead), ("left", aside)) if np.isfinite(seen)]
    return {"frequency_hz": float(frequencies()[k]), "ratio": float(ratio[k, axis]), "p": p, "axes": axes,
            "direction_deg": float(np.degrees(0.5 * np.arctan2(2.0 * both, ahead - aside))) if len(axes) == 2 else None}


def usual_level(usual: Sequence[Swing]) -> np.ndarray:
    """(FREQUENCIES, 2) power of normal flights."""
    return np.asarray(uniform_filter1d(np.mean([s.power for s in usual], axis=0), NEIGHBOURS, axis=0, mode="nearest"))


def freedom_of(mine: Sequence[Swing], usual: Sequence[Swing]) -> tuple[int, int]:
    """Degrees of freedom of the ratio of the power of flights to that of normal ones."""
    return 2 * sum(s.runs for s in mine), 2 * BINS * sum(s.runs for s in usual)


def tries(usual_power: np.ndarray) -> int:
    """Frequencies and axes among which a swing is looked for."""
    return int(np.isfinite(usual_power[0]).sum()) * FREQUENCIES


def _peaked(ratio: np.ndarray) -> np.ndarray:
    """(FREQUENCIES, 2) bool: a mode exceeds its neighbours on both sides, within the band. A rise towards the band's
    edge is drift or the controller."""
    found = np.zeros(ratio.shape, bool)
    with np.errstate(invalid="ignore"):
        found[BESIDE:-BESIDE] = ((ratio[:-2 * BESIDE] < HALF * ratio[BESIDE:-BESIDE])
                                 & (ratio[2 * BESIDE:] < HALF * ratio[BESIDE:-BESIDE]))
    return found


def where_to(swing: Mapping[str, Any]) -> str:
    """The direction of a swing in words."""
    if swing["direction_deg"] is not None:
        return f"along {swing['direction_deg']:.0f} degrees from ahead to the left"
    seen, unseen = ("to the left and right", "pitch") if swing["axes"] == ["left"] else ("ahead and back", "roll")
    return f"{seen} (the other axis cannot be seen without a {unseen})"


def spectra(here: Sequence[Swing], normal: Sequence[Swing]) -> dict[str, Any]:
    """For a picture: {frequency_hz, here, normal} with mean power over its level, largest of both axes."""
    def mean(part: Sequence[Swing]) -> list[float] | None:
        seen = [s.power for s in part if s.runs]
        if not seen or np.isnan(seen).all():
            return None
        power = np.mean(seen, axis=0)
        found: list[float] = np.nanmax(power[:, ~np.isnan(power).all(axis=0)], axis=1).tolist()
        return found

    return {"frequency_hz": frequencies().tolist(), "here": mean(here), "normal": mean(normal)}

"""A horizontal force that comes and goes: the finder of a load that swings below a vehicle.

A swing pulls the vehicle sideways without being asked by its tilt. What remains of the horizontal acceleration after
the tilt, with lags, has explained what it can, is looked at between LOWEST and HIGHEST: a load on a string of 0.1 to
2.8 m. Its spectrum is compared with that of the normal flights at the same frequency, since what every flight shows is
the controller. The largest ratio counts, tested against the F distribution with as many tries as there are frequencies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.stats import f as fisher

from nanobench_tools.flight import Span
from nanobench_tools.units import GRAVITY_M_S2

from .reconstruct import States

LOWEST_HZ, HIGHEST_HZ = 0.3, 1.6
BROAD_HZ = 4.0
"""Up to here the level of the residual beside the mode is taken."""
LAGS_ROWS = (0, 4, 8, 16, 32)
FREQUENCIES = 27
NEIGHBOURS, BINS = 11, 4
"""The level of the normal flights at a frequency is a mean over so many beside it, 0.5 Hz wide: so many independent
bins of a run of eight seconds."""
RESOLUTION_HZ = 0.06
"""Half a bin of a run of eight seconds: how well a frequency is known."""
RISK = 0.001
"""Of a swing in flights without one, over all frequencies and both axes."""
LEAST_S = 4.0


@dataclass(frozen=True)
class Swing:
    """Of one flight: power (FREQUENCIES, 2) of the residual forward and left over its level beside the mode, and runs:
    how many runs it is a mean of. nan where there is no tilt."""

    power: np.ndarray
    runs: int

    def to_json(self) -> dict[str, Any]:
        return {"power": self.power.tolist(), "runs": self.runs}

    @classmethod
    def from_json(cls, body: dict[str, Any]) -> Swing:
        power = np.array([[np.nan if v is None else v for v in row] for row in body["power"]], float)
        return cls(power, body["runs"])


def frequencies() -> np.ndarray:
    return np.linspace(LOWEST_HZ, HIGHEST_HZ, FREQUENCIES)


def swing_in(states: States, runs: Sequence[Span]) -> Swing:
    """The spectrum of what the tilt does not explain of one flight's horizontal acceleration."""
    total, count = np.zeros((FREQUENCIES, 2)), 0
    tilts = (states.pitch_rad, None if states.roll_rad is None else -states.roll_rad)
    if states.acceleration_m_s2 is None or states.yaw_rad is None or all(t is None for t in tilts):
        return Swing(np.full((FREQUENCIES, 2), np.nan), 0)
    push = states.heading(states.acceleration_m_s2)
    for run in runs:
        rows = np.flatnonzero(run.mask(states.time_s))
        if run.duration_s < LEAST_S or len(rows) < 3 * max(LAGS_ROWS):
            continue
        total += np.stack([np.full(FREQUENCIES, np.nan) if tilt is None else _peaks(push[:, k], tilt, rows, states)
                           for k, tilt in enumerate(tilts)], axis=1)
        count += 1
    return Swing(total / count if count else np.full((FREQUENCIES, 2), np.nan), count)


def _peaks(push: np.ndarray, tilt: np.ndarray, rows: np.ndarray, states: States) -> np.ndarray:
    """(FREQUENCIES,) power of the residual of one axis and run, over its mean level up to BROAD_HZ."""
    rows = rows[rows >= max(LAGS_ROWS)]
    design = np.column_stack([GRAVITY_M_S2 * tilt[rows - lag] for lag in LAGS_ROWS] +
                             [states.time_s[rows] ** k for k in (0, 1)])
    left = push[rows] - design @ np.linalg.lstsq(design, push[rows], rcond=None)[0]
    t = states.time_s[rows]
    window = np.hanning(len(rows))
    window /= np.sqrt((window**2).sum())

    def power(at_hz: np.ndarray) -> np.ndarray:
        return np.abs(np.exp(-2j * np.pi * np.outer(at_hz, t)) @ (window * left)) ** 2

    broad = power(np.arange(LOWEST_HZ, BROAD_HZ, 1.0 / (t[-1] - t[0])))
    return power(frequencies()) / max(float(np.median(broad) / np.log(2.0)), 1e-30)


def swing_of(here: Sequence[Swing], normal: Sequence[Swing]) -> dict[str, Any] | None:
    """{frequency_hz, direction_deg, ratio, p} of a swing that the flights ``here`` share and the normal ones lack."""
    mine, usual = [s for s in here if s.runs], [s for s in normal if s.runs]
    if not mine or not usual:
        return None
    tops, bases = (np.array([s.power for s in part]) for part in (mine, usual))
    usual_power = uniform_filter1d(bases.mean(axis=0), NEIGHBOURS, axis=0, mode="nearest")
    ratio = tops.mean(axis=0) / usual_power
    if np.isnan(ratio).all():
        return None
    k, axis = np.unravel_index(int(np.nanargmax(ratio)), ratio.shape)
    freedom = 2 * sum(s.runs for s in mine), 2 * BINS * sum(s.runs for s in usual)
    tries = int(np.isfinite(ratio[0]).sum()) * FREQUENCIES
    p = min(1.0, tries * float(fisher.sf(ratio[k, axis], *freedom)))
    if p > RISK or not (tops[:, k, axis] > usual_power[k, axis]).all():
        return None
    forward, left = np.nan_to_num(tops.mean(axis=0)[k])
    return {"frequency_hz": float(frequencies()[k]), "ratio": float(ratio[k, axis]), "p": p,
            "direction_deg": float(np.degrees(np.arctan2(np.sqrt(left), np.sqrt(forward))))}


def spectra(here: Sequence[Swing], normal: Sequence[Swing]) -> dict[str, Any]:
    """For a picture: {frequency_hz, here, normal} with mean power over its level, largest of both axes."""
    def mean(part: Sequence[Swing]) -> list[float] | None:
        seen = [s.power for s in part if s.runs]
        if not seen or np.isnan(seen).all():
            return None
        return np.nanmax(np.mean(seen, axis=0)[:, ~np.isnan(np.mean(seen, axis=0)).all(axis=0)], axis=1).tolist()

    return {"frequency_hz": frequencies().tolist(), "here": mean(here), "normal": mean(normal)}


def string_length(frequency_hz: float, mass_share: float = 0.0) -> float:
    """[m] of a pendulum with this mode, ``mass_share`` of the vehicle's mass below."""
    return GRAVITY_M_S2 * (1.0 + mass_share) / (2.0 * np.pi * frequency_hz) ** 2

"""The flown path, from the recording itself, for files without a sheet.

The reference curves of the benchmark are short sums of harmonics of one frequency, flown at a steady rate. Each family
uses its own set of harmonics per axis. All families are fitted over a grid of frequencies; the verdict is the one that
fits clearly better than any other, or none.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..flight import Flight
from ..settings import count, number, setting
from .interpolation import count_packets

UNKNOWN: dict[str, Any] = {"family": None, "speed": None, "reference_speed_m_s": None}

POINTS = count("sources.describe.points")
"""Samples of the curve that are fitted."""

FREQUENCIES_RAD_S = np.linspace(0.15, 2.6, 260)
"""Grid: half a step is a phase error of 0.2 rad in the third harmonic 15 s from the middle."""

CLEARLY = number("sources.describe.clearly")
"""The second best family must leave this many times more than the best."""

SMALLEST_AMPLITUDE = number("sources.describe.smallest_amplitude")
"""Every harmonic of a family must be there with this share of the largest one."""
RESIDUAL = setting("sources.describe.residual")
"""Largest share of the spread that a family may leave."""
TURNS = number("sources.describe.turns")
"""How much of the first harmonic must be seen."""
TREFOIL_TURNS = number("sources.describe.trefoil_turns")
"""The same of a trefoil."""
FEWEST_ROWS = count("sources.describe.fewest_rows")
"""Shorter set-points say no family."""
ROOM_M = number("sources.describe.room_m")
"""Set-points farther away are no numbers of a room."""
LONGEST_STEP_S = 1.0
"""Set-points further apart are no stream."""
GRID_S = number("sources.describe.grid_s")
"""Step of the grid that curves are read on."""
MOVES_M_S = number("sources.describe.moves_m_s")
"""A reference moves from this speed on."""
FLIES_M = number("sources.describe.flies_m")
"""And flies from this height on."""
SHORTEST_S = number("sources.describe.shortest_s")
"""Shorter paths say no family."""
FIRST_POINTS = count("sources.describe.first_points")
"""Points left out first: they hold the jump from the hover to the curve."""
LAST_POINTS = count("sources.describe.last_points")
"""Points left out last."""
THIN = number("sources.describe.thin")
"""A line is thinner than this share of its length."""
LEVEL_M = number("sources.describe.level_m")
"""And more level than this."""
LONG_M = number("sources.describe.long_m")
"""And has at least this standard deviation."""
SMALLEST_M = number("sources.describe.smallest_m")
"""Smaller curves say no family."""
CLIMBS_M = number("sources.describe.climbs_m")
"""An ellipse that climbs by more is a helix."""
ROUND = number("sources.describe.round")
"""Ratio of its axes from which on an ellipse is a circle."""
FAST_M_S = number("sources.describe.fast_m_s")
"""Reference speeds above this are called fast."""
MEDIUM_M_S = number("sources.describe.medium_m_s")
"""Above this medium."""
SLOW_M_S = number("sources.describe.slow_m_s")
"""Below this slow."""
TREFOIL_M_S = setting("sources.describe.trefoil_m_s")
"""Speeds of slow and medium trefoils, which are the same."""
UP_M = number("sources.describe.up_m")
"""Higher than this a vehicle flies."""
MEDIUM_S = number("sources.describe.medium_s")
"""A trefoil flown for longer is called medium."""
LOW_M = number("sources.describe.low_m")
"""A recording that begins and ends below this is whole."""


@dataclass(frozen=True)
class Curve:
    """Harmonics of x, y, z; ``climbs``: z also has a slope. Circle, oval and helix share one and are distinguished
    after.

    residual: the largest share of the curve's spread that may remain.

    turns: how much of the first harmonic must be seen, since a short piece of one curve looks like a piece of another.
    """

    family: str
    x: tuple[int, ...]
    y: tuple[int, ...]
    z: tuple[int, ...] = ()
    climbs: bool = False
    residual: float = RESIDUAL["other"]
    turns: float = TURNS


CURVES = (
    Curve("ellipse", (1,), (1,), climbs=True, residual=RESIDUAL["ellipse"]),
    Curve("figure_eight", (1,), (2,)),
    Curve("trefoil", (1, 2), (1, 2), (3,), turns=TREFOIL_TURNS),  # no other curve climbs at the third harmonic
    Curve("lissajous", (3,), (2,), residual=RESIDUAL["lissajous"]),
    Curve("star", (2, 3), (2, 3), residual=RESIDUAL["star"]),  # straight edges: two harmonics leave 0.11
)


def describe(flight: Flight) -> dict[str, Any]:
    """``family``, ``speed`` (slow, medium, fast), ``reference_speed_m_s``; None where the content is ambiguous."""
    path = _streamed(flight)
    if path is None:
        return dict(UNKNOWN)
    time_s, position = path
    family = _line(position) or _closed_curve(time_s, position)
    if family is None:
        return dict(UNKNOWN)
    if family == "linear_ramp":
        return {**UNKNOWN, "family": family}
    speed_m_s = _path_speed(time_s, position)
    return {
        "family": family,
        "speed": _speed_word(flight, family, speed_m_s),
        "reference_speed_m_s": round(speed_m_s, 2),
    }


def _streamed(flight: Flight) -> tuple[np.ndarray, np.ndarray] | None:
    """Setpoints (n,) s, (n, 3) m while the horizontal reference moves, ends trimmed; None when it hardly does."""
    stream = flight.streams.get("setpoint")
    if stream is None or not all(a in stream for a in "xyz") or len(stream) < FEWEST_ROWS:
        return None
    time_s, position = stream.time_s, stream["x", "y", "z"]
    usable = np.isfinite(position).all(axis=1) & (np.abs(position) < ROOM_M).all(axis=1)
    usable &= time_s <= count_packets(time_s, position).last_s
    time_s, position = time_s[usable], position[usable]
    if len(time_s) < FEWEST_ROWS or (np.diff(time_s) <= 0.0).any():
        return None
    if time_s[-1] - time_s[0] > len(time_s) * LONGEST_STEP_S:
        return None
    grid = np.arange(time_s[0], time_s[-1], GRID_S)
    at = np.stack([np.interp(grid, time_s, p) for p in position.T], axis=1)
    speed = np.linalg.norm(at[4:, :2] - at[:-4, :2], axis=1) / (4.0 * GRID_S)
    moving = np.flatnonzero((speed > MOVES_M_S) & (at[2:-2, 2] > FLIES_M)) + 2
    if not len(moving) or grid[moving[-1]] - grid[moving[0]] < SHORTEST_S:
        return None
    inside = slice(moving[0] + FIRST_POINTS, moving[-1] - LAST_POINTS)
    return grid[inside], at[inside]


def _line(position: np.ndarray) -> str | None:
    """Back and forth on a level straight line."""
    spread = np.ptp(position, axis=0)
    xy = position[:, :2] - position[:, :2].mean(axis=0)
    size = np.linalg.svd(xy, compute_uv=False)
    thin, long = size[1] < THIN * size[0], size[0] > LONG_M * np.sqrt(len(xy))
    return "linear_ramp" if thin and long and spread[2] < LEVEL_M else None


def _closed_curve(time_s: np.ndarray, position: np.ndarray) -> str | None:
    pick = np.linspace(0, len(time_s) - 1, min(POINTS, len(time_s))).round().astype(int)
    time_s, position = time_s[pick] - time_s.mean(), position[pick]
    centred = position - position.mean(axis=0)
    spread = float(np.sqrt((centred**2).sum(axis=1).mean()))
    if spread < SMALLEST_M:
        return None
    fits = _Fits(time_s, centred)
    best: list[tuple[float, float, str]] = []
    for curve in CURVES:
        total = sum(fits.residual(axis, h, curve.climbs and axis == 2) for axis,
                    h in enumerate((curve.x, curve.y, curve.z)))
        total = np.where(FREQUENCIES_RAD_S * np.ptp(time_s) < 2.0 * np.pi * curve.turns, np.inf, total)
        at = int(np.argmin(total))
        if not np.isfinite(total[at]):
            continue
        amplitudes = np.concatenate([fits.amplitudes(axis, h, at) for axis, h in enumerate((curve.x, curve.y))])
        if amplitudes.min() < SMALLEST_AMPLITUDE * amplitudes.max():
            continue
        if curve.z and fits.amplitudes(2, curve.z, at).min() < 0.5 * SMALLEST_AMPLITUDE * amplitudes.max():
            continue
        share = float(np.sqrt(max(total[at], 0.0) / len(time_s))) / spread
        best.append((share, curve.residual,
                     _ellipse(time_s, centred, amplitudes) if curve.family == "ellipse" else curve.family))
    best.sort()
    if not best or best[0][0] > best[0][1] or (len(best) > 1 and best[1][0] < CLEARLY * best[0][0]):
        return None
    return best[0][2]


def _ellipse(time_s: np.ndarray, position: np.ndarray, amplitudes: np.ndarray) -> str:
    slope = np.polyfit(time_s, position[:, 2], 1)[0]
    if abs(slope) * np.ptp(time_s) > CLIMBS_M:
        return "helix"
    return "circle" if amplitudes.min() > ROUND * amplitudes.max() else "oval"


class _Fits:
    """Least squares of each axis on sets of harmonics, for all frequencies of the grid at once."""

    def __init__(self, time_s: np.ndarray, position: np.ndarray) -> None:
        phase = FREQUENCIES_RAD_S[:, None] * time_s
        turn = np.exp(1j * phase)
        self.waves = {k: (w.real, w.imag) for k, w in ((1, turn), (2, turn**2), (3, turn**3))}
        self.line = np.broadcast_to(time_s / np.abs(time_s).max(), phase.shape)
        self.position = position
        self.solved: dict[tuple[Any, ...], tuple[np.ndarray, np.ndarray]] = {}

    def _solve(self, axis: int, harmonics: tuple[int, ...], slope: bool) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients (frequencies, p), constant first, and sums of squares left (frequencies,)."""
        key = (axis, harmonics, slope)
        if key not in self.solved:
            columns = [np.ones_like(self.line), *(w for k in harmonics for w in self.waves[k]),
                       *([self.line] if slope else [])]
            basis = np.stack(columns, axis=-1)
            signal = self.position[:, axis]
            gram = np.swapaxes(basis, 1, 2) @ basis + 1e-9 * len(signal) * np.eye(len(columns))
            right = np.swapaxes(basis, 1, 2) @ signal
            coefficients = np.linalg.solve(gram, right[..., None])[..., 0]
            left = signal @ signal - (right * coefficients).sum(axis=1)
            self.solved[key] = coefficients, left
        return self.solved[key]

    def residual(self, axis: int, harmonics: tuple[int, ...], slope: bool = False) -> np.ndarray:
        return self._solve(axis, harmonics, slope)[1]

    def amplitudes(self, axis: int, harmonics: tuple[int, ...], at: int) -> np.ndarray:
        c = self._solve(axis, harmonics, False)[0][at]
        return np.asarray(np.hypot(c[1 : 1 + 2 * len(harmonics) : 2], c[2 : 2 + 2 * len(harmonics) : 2]))


def _path_speed(time_s: np.ndarray, position: np.ndarray) -> float:
    """Mean speed along the curve, from chords of 0.2 s so that jitter of the timestamps does not lengthen it [m/s]."""
    return float(np.median(np.linalg.norm(position[4:] - position[:-4], axis=1) / (time_s[4:] - time_s[:-4])))


def _speed_word(flight: Flight, family: str, speed_m_s: float) -> str | None:
    """The benchmark's word. Slow and medium trefoils are the same reference and differ in how long they are flown."""
    if speed_m_s > FAST_M_S:
        return "fast"
    if family != "trefoil":
        return "medium" if speed_m_s > MEDIUM_M_S else "slow" if speed_m_s < SLOW_M_S else None
    mocap = flight.streams.get("mocap")
    if mocap is None or "pz" not in mocap or not TREFOIL_M_S[0] < speed_m_s < TREFOIL_M_S[1]:
        return None
    height = mocap["pz"]
    up = mocap.time_s[height > UP_M]
    if not len(up):
        return None
    if up[-1] - up[0] > MEDIUM_S:
        return "medium"
    whole = height[0] < LOW_M and height[-1] < LOW_M  # from the ground to the ground
    return "slow" if whole else None

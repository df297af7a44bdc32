"""Family and speed of a recording: what its sheet says, else what the flown path itself shows.

Without a sheet the tracked path is fitted with the few harmonics each family has (x + iy as a sum of rotating
arrows): a circle is one arrow, an oval two that turn against each other, a trefoil one and one that turns back twice
as fast. The simplest family that explains all but 5 % of the motion is taken, else ``unknown``.
"""

from __future__ import annotations

import numpy as np

from ..flight import Flight

UNKNOWN = "unknown"

ARROWS: tuple[tuple[str, tuple[int, ...]], ...] = (
    ("circle", (1,)), ("trefoil", (1, -2)), ("oval", (1, -1)), ("figure_eight", (1, -1, 2, -2)),
    ("star", (2, -3)), ("lissajous", (2, -2, 3, -3)),
)
"""Family -> multiples of the base frequency that turn in x + iy, simplest first. A helix is a circle that climbs."""

UNEXPLAINED = 0.05
CLIMB_M = 0.3
FAST_M_S, MEDIUM_M_S, LONG_S = 0.88, 0.62, 20.0
"""Speeds between the nominal 0.5, 0.75 and 1.0 m/s; a medium trefoil flies at 0.5 m/s too, but for 30 s, not 15."""


def family_of(flight: Flight) -> str:
    """``circle`` ``figure_eight`` ``oval`` ``star`` ``trefoil`` ... from the sheet or the path, or unknown."""
    known = flight.metadata.get("family")
    return str(known) if known else family_from_path(flight)


def speed_of(flight: Flight) -> str | None:
    """``slow`` ``medium`` ``fast`` from the sheet or the path; None where the sheet has a family but no speed."""
    if flight.metadata.get("speed"):
        return str(flight.metadata["speed"])
    return None if flight.metadata.get("family") else speed_from_path(flight)


def moving_part(flight: Flight) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(time_s (n,), position (n, 3) m, speed (n,) m/s) of the mocap rows in which a path is flown.

    The longest stretch faster than half the 90th percentile of horizontal speed, shorter pauses than 1 s bridged (not
    the landing and what hands do afterwards), less 2 s of swinging in.
    Motion capture is used because it goes on where a log of setpoints stopped.
    """
    mocap = flight["mocap"]
    time_s, position = mocap.time_s, mocap["px", "py", "pz"]
    if len(time_s) < 50 or not np.isfinite(position).all():
        return time_s[:0], position[:0], time_s[:0]
    step = max(round(0.1 / max(float(np.median(np.diff(time_s))), 1e-3)), 1)  # speeds over 0.1 s: noise stays small
    moved = np.linalg.norm(position[step:, :2] - position[:-step, :2], axis=1)
    speed = moved / np.maximum(time_s[step:] - time_s[:-step], 1e-3)
    fast = np.flatnonzero(speed > 0.5 * np.percentile(speed, 90.0))
    if not len(fast) or np.percentile(speed, 90.0) < 0.05:
        return time_s[:0], position[:0], time_s[:0]
    runs = np.split(fast, np.flatnonzero(np.diff(time_s[fast]) > 1.0) + 1)
    first, last = max(((run[0], run[-1]) for run in runs), key=lambda ends: time_s[ends[1]] - time_s[ends[0]])
    rows = np.arange(first, last + 1)
    rows = rows[time_s[rows] >= time_s[first] + 2.0]
    return time_s[rows], position[rows], speed[rows]


def speed_from_path(flight: Flight) -> str | None:
    """The nominal speed nearest to the median speed flown; None for a vehicle that hardly moves."""
    time_s, _, speed = moving_part(flight)
    if len(time_s) < 50:
        return None
    median = float(np.median(speed))
    if median > FAST_M_S:
        return "fast"
    if median > MEDIUM_M_S:
        return "medium"
    lasts = float(time_s[-1] - time_s[0])
    return "medium" if lasts > LONG_S and family_from_path(flight) == "trefoil" else "slow"


def family_from_path(flight: Flight) -> str:
    """Family by the harmonics of the flown path (see the top of this file); remembered by content hash."""
    key = flight.provenance.sha256
    if not key:
        return _family_from_path(flight)
    if key not in _families:
        _families[key] = _family_from_path(flight)
    return _families[key]


_families: dict[str, str] = {}


def _family_from_path(flight: Flight) -> str:
    time_s, position, _ = moving_part(flight)
    if len(time_s) < 100:
        return UNKNOWN
    keep = slice(None, None, max(len(time_s) // 400, 1))
    t, xy, z = time_s[keep] - time_s[0], position[keep, :2], position[keep, 2]
    spread = np.linalg.svd(xy - xy.mean(axis=0), compute_uv=False)
    if spread[1] < 0.1 * spread[0]:
        return "linear_ramp"
    path = xy @ np.array([1.0, 1.0j])
    for family, multiples in ARROWS:
        if min(_unexplained(t, path, sign * np.array(multiples)) for sign in (1, -1)) < UNEXPLAINED:
            climb = np.polyfit(t, z, 1)[0] * t[-1]
            return "helix" if family == "circle" and climb > CLIMB_M else family
    return UNKNOWN


def _unexplained(t: np.ndarray, path: np.ndarray, multiples: np.ndarray) -> float:
    """Smallest share of the path's variance left by a mean and arrows at ``multiples`` of any base frequency."""
    steps = max(round(2.0 * t[-1] / 0.25), 20)  # a quarter radian of phase over the whole stretch between two tries
    phases = np.multiply.outer(np.linspace(0.2, 2.2, steps), np.outer(t, np.append(multiples, 0)))
    arrows = np.exp(1j * phases)
    across = np.conj(np.swapaxes(arrows, 1, 2))
    # Slow bases make arrows look alike over a short stretch; the ridge keeps the least squares solvable there.
    normal = across @ arrows + 1e-9 * len(t) * np.eye(arrows.shape[2])
    fitted = np.linalg.solve(normal, across @ path[:, None])
    left = np.sum(np.abs(path[:, None] - arrows @ fitted) ** 2, axis=(1, 2))
    return float(left.min() / np.sum(np.abs(path - path.mean()) ** 2))

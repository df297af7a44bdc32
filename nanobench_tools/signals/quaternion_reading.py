"""How the four numbers of an attitude are to be read: which one is the scalar, and whether they are inverted.

An attitude is body to world, x, y, z, w. Another reading needs evidence that the numbers as stored contradict. Two
kinds are used: the vehicle accelerates towards the side to which it tilts, and the attitude turns as the gyro does.
Where both are known, both must prefer the other reading, or the path must and the gyro is in other axes. The gyro alone
does not decide if a sensor in other axes explains it as well.
"""

import math
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from .. import so3
from ..settings import number
from .flown_axes import UP, Axis, ground_axes_of, tilts_of
from .usable_rows import even_grid

STEP_S = 0.02
TURN_S = 0.1
"""Turning over this time contains little noise of attitude and gyro."""
REACH_S = 0.3
"""Largest delay between attitude and gyro that is tried."""
SHORTEST_S = 2.0
UPRIGHT = 0.5
FITS = number("audit.quaternion_reading.fits")
CLEARLY = number("audit.quaternion_reading.clearly")
ROTATIONS = np.array([turn for order in permutations(range(3)) for signs in product((1.0, -1.0), repeat=3)
                      for turn in [np.eye(3)[list(order)] * np.array(signs)[:, None]] if np.linalg.det(turn) > 0.0])
"""(24, 3, 3) turns of a sensor by quarter and half turns."""

Samples = tuple[np.ndarray, np.ndarray]
"""Times (n,) s and values (n, k)."""


@dataclass(frozen=True)
class Reading:
    """``order``: elements as they are stored; ``places``: where x, y, z, w are; ``inverted``: world to body."""

    order: str
    places: tuple[int, int, int, int]
    inverted: bool = False

    @property
    def as_stored(self) -> bool:
        return self == AS_STORED

    def of(self, quaternion: np.ndarray) -> np.ndarray:
        """(n, 4) as stored -> body to world, x, y, z, w."""
        read = quaternion[:, list(self.places)]
        return np.asarray(so3.conjugate(read)) if self.inverted else read

    @property
    def change(self) -> str:
        """What to change in a map that names the columns as they are stored."""
        names = ("qx", "qy", "qz", "qw")
        minus = ("-", "-", "-", "") if self.inverted else ("", "", "", "")
        if self.places == AS_STORED.places:
            return "change the sign of qx, qy, qz"
        return "read " + ", ".join(f"{n} = {m}{names[p]}" for n, m, p in zip(names, minus, self.places, strict=True))

    @property
    def meaning(self) -> str:
        """``in the order w, x, y, z and inverted (world to body)``."""
        parts = [] if self.places == AS_STORED.places else [f"in the order {self.order}"]
        return " and ".join([*parts, *["inverted (world to body)"] * self.inverted])


AS_STORED = Reading("x, y, z, w", (0, 1, 2, 3))
SCALAR_FIRST = Reading("w, x, y, z", (1, 2, 3, 0))
SCALAR_LAST_READ_FIRST = Reading("y, z, w, x", (3, 0, 1, 2))
"""A file in x, y, z, w that was read as w, x, y, z."""


@dataclass(frozen=True)
class _Fit:
    """Evidence for one reading; nan where it is unknown.

    - path: tilt against acceleration; other_axes: the same with other axes of world and body up;
    - gyro: turning against the gyro; sensor: the same with a gyro in any other axes;
    - ground: axes that may point up;
    - each: as ``path``, of the horizontal axis that follows least."""

    path: float
    other_axes: float
    gyro: float
    sensor: float
    ground: frozenset[Axis]
    each: float


def reading_of(attitude: Samples, path: Samples | None, gyro: Samples | None, base: Reading = AS_STORED
               ) -> tuple[Reading, str]:
    """The reading of quaternions (n, 4) as stored, ``base`` where nothing contradicts it, and the evidence in words.

    path: (n, 3) with z up; gyro: (n, 3) in the axes of the body. Each has its times. Units do not matter."""
    start = _fit(base, attitude, path, gyro)
    if (math.isnan(start.path) or start.path > 1.0 - CLEARLY) and (math.isnan(start.gyro) or start.gyro > FITS):
        return base, ""
    found = []
    orders = (base, SCALAR_FIRST, SCALAR_LAST_READ_FIRST) if base == AS_STORED else (base,)
    for order, inverted in product(orders, (False, True)):
        reading = Reading(order.order, order.places, inverted)
        if reading != base and _upright(reading.of(attitude[1])):
            fit = _fit(reading, attitude, path, gyro)
            if _better(fit, start):
                found.append((np.nansum([fit.path, fit.gyro]), reading, fit))
    if not found:
        return base, ""
    _, best, fit = max(found, key=lambda entry: entry[0])
    shown = [f"{what} {new:+.2f} ({old:+.2f} as stored)" for what, new, old in (
        ("tilt and acceleration then correlate", fit.path, start.path),
        ("turning and gyro", fit.gyro, start.gyro)) if not math.isnan(new)]
    return best, ", ".join(shown)


def _better(fit: _Fit, start: _Fit) -> bool:
    """Whether a reading explains the flight, and the one it replaces does not."""
    drops = [new < FITS or new < old + CLEARLY for new, old in ((fit.path, start.path), (fit.gyro, start.gyro))
             if not math.isnan(new)]
    if math.isnan(fit.path):
        return drops == [False] and fit.gyro > start.sensor + CLEARLY
    if not math.isnan(fit.gyro) and not any(drops):
        return True
    blind = math.isnan(fit.gyro) or (start.gyro < FITS < fit.sensor)  # no gyro, or one in other axes
    # one axis alone may as well be in another unit
    return blind and fit.each > FITS and not drops[0] and (UP in start.ground or start.other_axes < fit.path - CLEARLY)


def _upright(quaternion: np.ndarray) -> bool:
    x, y = quaternion[:, 0], quaternion[:, 1]
    return bool(np.nanmean(1.0 - 2.0 * (x * x + y * y)) > UPRIGHT)


def _fit(reading: Reading, attitude: Samples, path: Samples | None, gyro: Samples | None) -> _Fit:
    time_s, q = attitude[0], reading.of(attitude[1])
    follows, others, each, ground = math.nan, math.nan, math.nan, frozenset[Axis]()
    if path is not None:
        on_path = np.stack([np.interp(time_s, path[0], p) for p in path[1].T], axis=1)
        if tilts := tilts_of(time_s, on_path, q):
            follows, each, ground = tilts[UP, UP].follows, tilts[UP, UP].each, frozenset(ground_axes_of(*path))
            others = max((t.follows for axes, t in tilts.items() if axes != (UP, UP) and t.upright > UPRIGHT),
                         default=-1.0)
    k = None if gyro is None else _turning(time_s, q, *gyro)
    straight, sensor = (math.nan, math.nan) if k is None else (
        float(np.trace(k, axis1=1, axis2=2).max()), float(np.einsum("rij,lij->rl", ROTATIONS, k).max()))
    return _Fit(follows, others, straight, sensor, ground, each)


def _turning(time_s: np.ndarray, quaternion: np.ndarray, gyro_s: np.ndarray, gyro: np.ndarray) -> np.ndarray | None:
    """(delays, 3, 3) correlation of the turning by the gyro with that by the attitude, all axes together: a perfect
    attitude has trace 1. None where they do not overlap, or do not move."""
    grid = even_grid(max(time_s[0], gyro_s[0]) + REACH_S, min(time_s[-1], gyro_s[-1]) - REACH_S - TURN_S, STEP_S,
                     len(gyro_s))
    if len(grid) * STEP_S < SHORTEST_S:
        return None

    def at(times: np.ndarray) -> np.ndarray:
        q = np.stack([np.interp(times, time_s, v) for v in so3.make_continuous(quaternion).T], axis=1)
        return np.asarray(q / np.maximum(np.linalg.norm(q, axis=1, keepdims=True), 1e-9))

    turned = so3.log(so3.multiply(so3.conjugate(at(grid)), at(grid + TURN_S)))
    steps = np.diff(gyro_s)[:, None]
    angle = np.vstack([np.zeros(3), np.cumsum(0.5 * (gyro[1:] + gyro[:-1]) * steps, axis=0)])
    turned = turned - turned.mean(axis=0)
    found = []
    for delay in np.arange(-REACH_S, REACH_S + 0.5 * STEP_S, STEP_S):
        by_gyro = np.stack([np.interp(grid + delay + TURN_S, gyro_s, a) - np.interp(grid + delay, gyro_s, a)
                            for a in angle.T], axis=1)
        by_gyro -= by_gyro.mean(axis=0)
        size = float(np.linalg.norm(by_gyro) * np.linalg.norm(turned))
        found.append(by_gyro.T @ turned / size if size > 0.0 else np.full((3, 3), np.nan))
    k = np.array(found)
    return k if np.isfinite(k).all() else None

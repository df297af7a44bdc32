"""Structure that no term explains, found by flexible models without physics.

The flights that judge such a model are not those it was fitted to, so that "unknown" comes with a place and a size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.ndimage import gaussian_filter1d, maximum_filter1d
from scipy.stats import gamma

from nanobench_tools import so3
from nanobench_tools.settings import count, number, setting

from .moments import Moments
from .track import ROW_S
from .wrench import FORCE_ROWS, Wrench

PLACES = count("mismatch.leftover.places")
LEAST_FORCE_M_S2 = number("mismatch.leftover.least_force_m_s2")
LEAST_GAIN = number("mismatch.leftover.least_gain")
ONE_PATH = number("mismatch.leftover.one_path")
PERIODS_HZ = setting("mismatch.leftover.periods_hz")
FAST_HZ = setting("mismatch.leftover.fast_hz")
STRONG_M_S2 = number("mismatch.leftover.strong_m_s2")
PEAK_P = number("mismatch.leftover.peak_p")
LATE_S = ROW_S
"""Re-timed timestamps are off by less; a path flown in circles then leaves a force that goes round as often."""
BURST_SD = number("mismatch.leftover.burst_sd")
BURSTS = count("mismatch.leftover.bursts")
BURST_ROWS = count("mismatch.leftover.burst_rows")


RESTLESS_M_S2 = number("mismatch.leftover.restless_m_s2")
SLOW_S = number("mismatch.leftover.slow_s")
MOST_FLIGHTS = number("mismatch.leftover.most_flights")
AT_PLACE = number("mismatch.leftover.at_place")
PERIOD_STEP_HZ = number("mismatch.leftover.period_step_hz")
BURST_SHARE = number("mismatch.leftover.burst_share")
GUST_AXIS = number("mismatch.leftover.gust_axis")


@dataclass(frozen=True)
class Structure:
    """Force that no term explains.

    ``kind``: place, time, motion, period, bursts or gusts. ``size_m_s2``: RMS of the force (of bursts: while they last,
    a fraction ``share`` of the time). ``gain``: squared standard deviations that it explains on held-out flights.
    ``hint``: a sentence.
    """

    kind: str
    size_m_s2: float
    gain: float
    axes: tuple[str, ...]
    hint: str
    flights: tuple[int, ...] = ()
    share: float = 1.0
    rows: np.ndarray | None = None
    """(rows,) bool: of all tracks end to end, where bursts last."""

    @property
    def rms_m_s2(self) -> float:
        """Over all of the time."""
        return float(self.size_m_s2 * self.share**0.5)


def structures(moments: Moments, force: np.ndarray) -> list[Structure]:
    """Structures in the force residual (N, 3), body; largest gain first."""
    wrench = moments.wrench
    at = wrench.force_at
    flight = wrench.flight[at]
    found = [s for s in (_place(moments, force, flight), _time(moments, force, flight),
                         _motion(moments, force, flight), _period(moments, force, flight),
                         _bursts(moments, force, flight)) if s is not None]
    return sorted(found, key=lambda s: -s.gain)


def _held_out(moments: Moments, target: np.ndarray, features: np.ndarray, flight: np.ndarray,
              channels: Sequence[int]) -> tuple[float, float, np.ndarray]:
    """(gain, RMS of the prediction, gain of each flight): regression on the other flights, ridge of one sample."""
    gains, predicted = np.zeros(flight.max() + 1), np.zeros_like(target)
    for c in channels:
        memory = moments.channels[min(c, 2)].memory
        white, columns = memory.whiten(target[:, c]), memory.whiten(features)
        sd = np.sqrt(np.mean(white[memory.judged] ** 2))
        for f in np.unique(flight):
            others = flight != f
            normal = columns[others].T @ columns[others]
            ridge = 1e-3 * np.trace(normal) / len(normal)
            beta = np.linalg.solve(normal + ridge * np.eye(len(normal)), columns[others].T @ white[others])
            here = ~others
            left = white[here] - columns[here] @ beta
            gains[f] += (white[here] @ white[here] - left @ left) / sd**2
            predicted[here, c] = (features[here] - features[here].mean(0)) @ beta
    present = np.unique(flight)
    size = float(np.sqrt(np.mean(np.sum(predicted[:, list(channels)] ** 2, axis=1))))
    return float(gains.sum()), size, gains[present]


def _accepted(gain: float, size: float, each: np.ndarray) -> bool:
    return bool(gain > LEAST_GAIN and size > LEAST_FORCE_M_S2 and np.mean(each > 0.0) >= MOST_FLIGHTS)


def _place(moments: Moments, force: np.ndarray, flight: np.ndarray) -> Structure | None:
    """A force of the room: of the place, in the world, not of the vehicle."""
    wrench = moments.wrench
    if len(np.unique(flight)) < 2:
        return None
    at = wrench.force_at
    position = wrench.of("position_m", at)
    centres, _ = kmeans2(position, PLACES, seed=0, minit="++")
    spread = np.median(np.sort(np.linalg.norm(centres[:, None] - centres[None], axis=2), axis=1)[:, 1]) + 1e-6
    blobs = np.exp(-0.5 * np.sum((position[:, None] - centres[None]) ** 2, axis=2) / spread**2)
    world = so3.rotate(wrench.quaternion[at], force)
    features = np.concatenate([blobs, position - position.mean(0), np.ones((len(at), 1))], axis=1)
    gain, size, each = _held_out(moments, world, features, flight, (0, 1, 2))
    if not _accepted(gain, size, each):
        return None
    strength = np.linalg.norm([world[there].mean(0) if there.any() else np.zeros(3) for there in blobs.T > AT_PLACE],
                              axis=1)
    x, y, z = centres[int(np.argmax(strength))]
    also = ", or of how it flies there: all flights pass there alike" if _one_path(wrench, features) else ""
    return Structure("place", size, gain, ("x", "y", "z"),
                     f"a force that depends on the place in the room, strongest near x {x:.1f}, y {y:.1f}, z {z:.1f} m"
                     + also)


def _one_path(wrench: Wrench, features: np.ndarray) -> bool:
    """Whether the place determines the motion there, so that a force of one is also a force of the other."""
    velocity = wrench.of("velocity_m_s", wrench.force_at)[:, :2]
    left = velocity - features @ np.linalg.lstsq(features, velocity, rcond=None)[0]
    return bool(np.sum(left**2) < ONE_PATH * np.sum(velocity**2))


def _time(moments: Moments, force: np.ndarray, flight: np.ndarray) -> Structure | None:
    """Something that changes from take-off on, along the thrust."""
    wrench = moments.wrench
    if len(np.unique(flight)) < 2:
        return None
    since = wrench.of("since_s", wrench.force_at)
    t = since / max(since.max(), 1.0)
    features = np.stack([np.ones_like(t), t, t**2, t**3, np.exp(-since / 3.0), np.exp(-since / 10.0)], axis=1)
    gain, size, each = _held_out(moments, force, features, flight, (2,))
    if not _accepted(gain, size, each):
        return None
    return Structure("time", size, gain, ("z",), "thrust that changes with the time since take-off")


def _motion(moments: Moments, force: np.ndarray, flight: np.ndarray) -> Structure | None:
    """A force that depends on the vehicle's motion in a way that no term models."""
    wrench = moments.wrench
    if len(np.unique(flight)) < 2:
        return None
    at = wrench.force_at
    v = so3.rotate_inverse(wrench.quaternion[at], wrench.of("velocity_m_s", at))
    w = wrench.of("rate_rad_s", at)
    speed = np.linalg.norm(v, axis=1, keepdims=True)
    features = np.concatenate([np.ones((len(at), 1)), v, v * speed, v * speed**2, v**2, v * np.roll(v, 1, axis=1), w,
                               np.tanh(4.0 * v)], axis=1)
    gain, size, each = _held_out(moments, force, features, flight, (0, 1, 2))
    if not _accepted(gain, size, each):
        return None
    return Structure("motion", size, gain, ("x", "y", "z"), "a force that follows the vehicle's velocity or rates")


def _period(moments: Moments, force: np.ndarray, flight: np.ndarray) -> Structure | None:
    """One frequency that all flights share, far above its neighbours in the residual after its autoregression. The
    autoregression also absorbs a strong swing; above the path's own frequencies, one step of memory is removed
    instead."""
    known = [moments.channels[c].memory.whiten(force[:, c]) for c in range(3)]
    found = (_peak(moments, force, known, flight, PERIODS_HZ, 0.5 * LEAST_FORCE_M_S2),
             _peak(moments, force, [_one_step(force[:, c]) for c in range(3)], flight, FAST_HZ, STRONG_M_S2))
    return max((s for s in found if s is not None), key=lambda s: s.size_m_s2, default=None)


def _one_step(values: np.ndarray) -> np.ndarray:
    """(n,) with one-step memory removed: slowly changing air becomes white, a swing does not."""
    x = values - values.mean()
    return np.concatenate([[0.0], x[1:] - x[:-1] * float(x[1:] @ x[:-1]) / max(float(x @ x), 1e-12)])


def _peak(moments: Moments, force: np.ndarray, whites: Sequence[np.ndarray], flight: np.ndarray,
          range_hz: tuple[float, float], least_m_s2: float) -> Structure | None:
    best: tuple[float, float, int] | None = None
    dt = FORCE_ROWS * ROW_S
    grid = np.arange(*range_hz, PERIOD_STEP_HZ)
    for c, white in enumerate(whites):
        power, many = np.zeros(len(grid)), 0
        for f in np.unique(flight):
            mine = np.flatnonzero((flight == f) & moments.channels[c].memory.judged)
            x = white[mine] - white[mine].mean()
            time = moments.wrench.of("time_s", moments.wrench.force_at[mine])
            if len(x) * dt < 6.0 or not x.any():
                continue
            wave = np.exp(-2j * np.pi * grid[:, None] * time[None])
            power += np.abs(wave @ x) ** 2 / (x @ x)
            many += 1
        if not many:
            continue
        near = np.array([np.median(power[np.abs(grid - g) < 0.8]) for g in grid])
        ratio = power / near * gamma.median(many)
        at = int(np.argmax(ratio))
        if gamma.sf(ratio[at], many) * len(grid) < PEAK_P and (best is None or ratio[at] > best[1]):
            best = (float(grid[at]), float(ratio[at]), c)
    if best is None:
        return None
    hertz, ratio, c = best
    heights = []
    for f in np.unique(flight):
        mine = flight == f
        time = moments.wrench.of("time_s", moments.wrench.force_at[mine])
        wave = np.exp(-2j * np.pi * hertz * time)
        both = np.stack([force[mine, c], moments.wrench.measured[0][mine, c]], axis=1)
        heights.append(np.abs(wave @ both) * 2.0 / mine.sum())
    size, moves = np.mean(heights, axis=0) / np.sqrt(2.0)
    if size < max(least_m_s2, 2.0 * np.pi * hertz * LATE_S * moves):
        return None
    return Structure("period", float(size), ratio * 10.0, ("xyz"[c],),
                     f"a force that swings at {hertz:.2f} Hz along body {'xyz'[c]}")


def _bursts(moments: Moments, force: np.ndarray, flight: np.ndarray) -> Structure | None:
    """Short events, far outside the noise."""
    memory = moments.channels[2].memory
    white = memory.whiten(force[:, 2])
    sd = 1.4826 * np.median(np.abs(white[memory.judged]))
    far = np.abs(white) > BURST_SD * sd
    events = int(np.sum(far & ~np.concatenate([[False] * 3, far[:-3]])))
    share = float(np.sum(white[far] ** 2) / np.sum(white**2))
    if events < BURSTS or share < BURST_SHARE:
        return None
    size = float(np.sqrt(np.mean(force[far, 2] ** 2)))
    named = tuple(np.unique(flight[far]).tolist())
    return Structure("bursts", size, share * len(white), ("z",), f"{events} short losses or gusts along body z", named,
                     float(np.mean(far)), _around(moments.wrench, far))


def _around(wrench: Wrench, far: np.ndarray) -> np.ndarray:
    """Rows within BURST_ROWS of the samples of force that are far off."""
    hit = np.zeros(len(wrench.track))
    hit[wrench.force_at[far]] = 1.0
    return np.asarray(maximum_filter1d(hit, 2 * BURST_ROWS + 1) > 0.0)


def gusts(moments: Moments, force: np.ndarray) -> Structure | None:
    """A force (N, 3), body, that comes and goes without any pattern and is stronger than that of still air."""
    wrench = moments.wrench
    track = wrench.track[wrench.force_at]
    step = FORCE_ROWS * ROW_S
    parts = [force[track == k] for k in np.unique(track)]
    slow = [gaussian_filter1d(part - part.mean(axis=0), SLOW_S / step, axis=0) for part in parts]
    rms = np.sqrt(np.mean(np.concatenate(slow) ** 2, axis=0))
    size = float(np.linalg.norm(rms))
    if size < RESTLESS_M_S2:
        return None
    axes = tuple("xyz"[i] for i in range(3) if rms[i] > GUST_AXIS * size)
    return Structure("gusts", size, 0.0, axes, f"a force that comes and goes without a pattern, {size:.2f} m/s^2 RMS, "
                     f"and lasts some {_lasting(slow, step):.1f} s, as gusts do")


def _lasting(slow: Sequence[np.ndarray], step_s: float) -> float:
    """Correlation time [s]: the autocorrelation falls below 1 / e."""
    longest = max(len(part) for part in slow) - 1
    for lag in range(1, longest):
        pairs = [(part[lag:], part[:-lag]) for part in slow if len(part) > lag]
        after, before = (np.concatenate([pair[i] for pair in pairs]) for i in (0, 1))
        if np.sum(after * before) < np.sum(before**2) / np.e:
            return lag * step_s
    return longest * step_s

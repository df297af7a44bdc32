"""The clock of the vehicle's messages: which timestamp a packet gets. Positive error = the timestamp is late."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..settings import number

WANDER_EVERY_S = number("practice.clock.wander_every_s")
WANDER_RISE_S = number("practice.clock.wander_rise_s")
WANDER_DECAY_S = number("practice.clock.wander_decay_s")
SMALLEST_STEP_S = number("practice.clock.smallest_step_s")


@dataclass(frozen=True)
class ClockError:
    """stamp(t) = t + offset_s + drift t + wander(t); the wander is a sum of jumps (time, size) that decay.

    ``wander_mean_s`` is taken off, so that offset_s is the mean error.
    """

    offset_s: float = 0.0
    drift: float = 0.0
    jumps_s: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    wander_mean_s: float = 0.0

    def late_s(self, time_s: np.ndarray) -> np.ndarray:
        """Error (n,) s of the timestamps of true times (n,)."""
        t = np.asarray(time_s, float)
        since = t[:, None] - self.jumps_s[:, 0]
        rise = np.clip(since / WANDER_RISE_S, 0.0, 1.0)
        wander = self.jumps_s[:, 1] * rise * np.exp(-np.maximum(since - WANDER_RISE_S, 0.0) / WANDER_DECAY_S)
        return np.asarray(self.offset_s + self.drift * t + wander.sum(axis=1) - self.wander_mean_s)

    def stamp(self, time_s: np.ndarray) -> np.ndarray:
        """Timestamps (n,) of true times (n,), rising: a host never sees packets of one log block overtake each
        other."""
        t = np.asarray(time_s, float)
        step = SMALLEST_STEP_S * np.arange(len(t))
        return np.asarray(np.maximum.accumulate(t + self.late_s(t) - step) + step)

    def shifted(self, first_s: float) -> ClockError:
        """The same error for times counted from ``first_s``."""
        jumps = self.jumps_s - np.array([first_s, 0.0])
        return ClockError(self.offset_s + self.drift * first_s, self.drift, jumps, self.wander_mean_s)


def draw_clock(rng: np.random.Generator, duration_s: float, offset_s: float = 0.0, drift: float = 0.0,
               wander_sd_s: float = 0.0) -> ClockError:
    """A clock error for a flight of ``duration_s``; the sawtooth has exactly this standard deviation over it."""
    if wander_sd_s <= 0.0:
        return ClockError(offset_s, drift)
    count = int(2.0 * duration_s / WANDER_EVERY_S) + 10
    at = np.cumsum(rng.exponential(WANDER_EVERY_S, count)) - 1.0
    size = rng.uniform(0.5, 1.5, count)
    keep = at < duration_s
    raw = ClockError(0.0, 0.0, np.stack([at[keep], size[keep]], axis=1))
    late = raw.late_s(np.arange(0.0, duration_s, 0.01))
    scale = wander_sd_s / late.std()
    return ClockError(offset_s, drift, raw.jumps_s * np.array([1.0, scale]), float(late.mean() * scale))

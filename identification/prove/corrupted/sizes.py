"""The smallest change of a belief that predictions show: the size at which an error of them rises by a tenth.

Predictions are open loop, from measured states, 0.1 and 0.5 s ahead, on the flights of the case. No engine takes part.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from identification.mismatch.proof import HORIZONS, prediction_errors, window_starts
from identification.mismatch.track import Track
from nanobench_tools.physics import Model

AHEAD = (10, 50)
"""Rows of 10 ms."""
RISES = 0.10
"""Of an error, relative: the smallest change that predictions show."""
TIMES = (0.5, 1.25, 3.0, 8.0)
"""Sizes of the cases, over the smallest that predictions show."""
VISIBLE = 0.25
"""Of an error, relative: an effect that a diagnosis has to find."""
LEAST = 1e-4
"""Of the start of a search: smaller sizes are not looked for."""
STEPS = 6
"""Halvings of the search, in the logarithm of the size."""


def errors(model: Model, tracks: Sequence[Track]) -> np.ndarray:
    """(2, 4) mean errors AHEAD of position, velocity, attitude and rate; nan for what is not predicted."""
    numbers = sorted({t.flight for t in tracks})
    found = prediction_errors(model, tracks, numbers)
    has = [any(len(window_starts(t)) for t in tracks if t.flight == n) for n in numbers]
    return np.asarray(found[has].mean(axis=0)[[HORIZONS.index(h) for h in AHEAD]])


def rise(errors_of: np.ndarray, nominal: np.ndarray) -> float:
    """The largest relative rise of an error over that of the nominal simulator."""
    with np.errstate(invalid="ignore"):
        return float(np.nanmax(errors_of / np.maximum(nominal, 1e-12) - 1.0))


def smallest_shown(rise_at: Callable[[float], float], start: float, most: float) -> float | None:
    """The size at which ``rise_at`` reaches RISES; None where it does not up to ``most``.

    >>> round(smallest_shown(lambda x: x * x, 0.01, 10.0), 2)
    0.32
    """
    low, high = 0.0, min(start, most)
    while rise_at(high) < RISES:
        if high >= most:
            return None
        low, high = high, min(2.5 * high, most)
    if low == 0.0:  # already shown at the start of the search
        low = high / 2.5
        while rise_at(low) >= RISES and low > LEAST * start:
            low, high = low / 2.5, low
    for _ in range(STEPS):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if rise_at(middle) >= RISES else (middle, high)
    return high


def thinned(tracks: Sequence[Track], most_s: float) -> list[Track]:
    """Tracks whose judged rows are at most so many seconds of each flight, its first: a size needs no more."""
    left = {t.flight: round(most_s / 0.01) for t in tracks}
    found = []
    for track in tracks:
        counts = track.counts & (np.cumsum(track.counts) <= left[track.flight])
        left[track.flight] -= int(counts.sum())
        if counts.any():
            found.append(replace(track, counts=counts))
    return found

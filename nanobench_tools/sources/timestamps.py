"""Whether timestamps can be seconds: a file in another unit must not be read as one that lasts for hours, or years."""

from __future__ import annotations

import numpy as np

LATEST_S = 4.2e9
"""Unix time of the year 2103."""
LONGEST_STEP_S = 1.0
"""Longest step between rows of a recording of a vehicle in flight; more widely spaced rows are not judged."""


def not_seconds(stamps: np.ndarray, declared: bool = False) -> str | None:
    """Why stamps (n,) are not in seconds, None where they may be. ``declared``: the file itself says that they are, so
    that rare rows are believed."""
    finite = stamps[np.isfinite(stamps)]
    if not len(finite):
        return None
    middle = float(np.median(np.abs(finite)))
    if middle > LATEST_S:
        return f"timestamps of about {middle:.4g} are no seconds"
    step = float(np.median(np.diff(finite))) if len(finite) > 2 else 0.0
    if step > LONGEST_STEP_S and not declared:
        return f"timestamps that are {step:.4g} apart are no seconds of a recording"
    return None


COUNTERS = (2.0**16, 2.0**32)
"""Counters of milliseconds and microseconds begin again after so many."""
LONGEST_WRAP = 10.0
"""Steps, at most, from the last row before a counter begins again to the first one after."""


def counted_on(stamps: np.ndarray) -> np.ndarray:
    """(n,) numbers of a counter that began again at 0, counted on; all others as they are."""
    known = stamps[np.isfinite(stamps)]
    steps = np.diff(known)
    size = next((size for size in COUNTERS if len(known) and known.max() < size), 0.0)
    back = steps < 0.0
    if not size or not back.any() or known.min() < 0.0 or np.any(known != np.round(known)):
        return stamps
    usual = float(np.median(steps[~back])) if (~back).any() else 0.0
    if np.any((size + steps)[back] > LONGEST_WRAP * usual):
        return stamps
    found = stamps.copy()
    found[np.isfinite(stamps)] += size * np.concatenate([[0], np.cumsum(back)])
    return found

"""rounded_time: the timestamps are rounded to steps that the sampling does not fit: 40 Hz in hundredths of a second.

Found where all usual steps between rows are multiples of one step, of a fifth of the usual distance of rows or more.
Each timestamp is then off by up to half a step. The rows may be evenly spaced at another distance, or unevenly. Rows
lost from an even series leave multiples of its distance; they are no finding. Velocities and rates from such rows have
the error of the timestamps. Several rows of one timestamp are ``coarse_time``.

Size: the step, s. Smallest found: a fifth of the distance between rows.
"""

import numpy as np

from ...flight import Fault, Flight
from ...settings import number
from ...signals.context import Context
from ...signals.usable_rows import advancing, coarse_tables, tables
from .kind import FaultKind

KIND = "rounded_time"

LEAST_SHARE = number("audit.rounded_time.least_share")
FINEST_S = 1e-5
"""Steps are compared to this resolution: Unix time in double precision has 2e-7 s."""
USUAL = 0.01
"""Share of the rows with a step that counts as usual."""
ALL = 0.95
WINDOW = 100
"""Rows that are fitted by an even series."""
FEWEST = 50
OFF = 0.75
"""Of a step: largest distance of rounded timestamps from a line fitted to them."""
OTHER_STEPS = 0.1
"""Share of the rows with another step than most, below which they are gaps of lost rows."""


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per table of timestamps."""
    coarse = {stream for stream, _ in context.once(coarse_tables)}
    faults = []
    for stream, stamps in context.once(tables):
        t = stamps[advancing(stamps)]
        if stream in coarse or len(t) < FEWEST or (step := rounding_s(t)) is None:
            continue
        usual, even = float(np.mean(np.diff(t)[np.diff(t) < 3.0 * np.median(np.diff(t))])), _even(t, step)
        spacing = f"evenly {1e3 * usual:.3g} ms apart ({1.0 / usual:.3g} Hz)" if even else (
            f"unevenly, on average {1e3 * usual:.3g} ms apart")
        faults.append(Fault(KIND, stream, ("t",), float(t[0]), float(t[-1]), step, "s",
                            f"timestamps are rounded to {1e3 * step:.4g} ms and the rows are {spacing}: each is off by "
                            f"up to {0.5e3 * step:.4g} ms", LEAST_SHARE * usual))
    return faults


def rounding_s(time_s: np.ndarray) -> float | None:
    """The step [s] to which rising timestamps (n,) are rounded; None where they are as fine as their distance needs,
    or even as written."""
    steps = np.rint(np.diff(time_s) / FINEST_S).astype(int)
    values, rows = np.unique(steps[steps > 0], return_counts=True)
    usual = values[rows >= USUAL * len(steps)]
    if len(usual) < 2 or rows[rows >= USUAL * len(steps)].sum() < ALL * len(steps):
        return None
    rounding = int(np.gcd.reduce(usual))
    most = int(values[np.argmax(rows)])
    if rounding < LEAST_SHARE * float(np.median(steps)):
        return None
    step = rounding * FINEST_S
    lost_rows = most == rounding and (1.0 - rows.max() / len(steps) < OTHER_STEPS or not _even(time_s, step))
    return None if lost_rows else step


def _even(time_s: np.ndarray, step_s: float) -> bool:
    """Whether evenly spaced rows explain most windows to within the rounding."""
    size = min(WINDOW, len(time_s))
    parts = time_s[:len(time_s) // size * size].reshape(-1, size)
    k = np.arange(size) - 0.5 * (size - 1)
    parts = parts - parts.mean(axis=1, keepdims=True)
    left = parts - (parts @ k / (k @ k))[:, None] * k
    return bool(np.mean(np.abs(left).max(axis=1) < OFF * step_s) > 0.5)


FAULT = FaultKind(KIND, find, __doc__,
                  told="{evidence}",
                  advice="write the file again with more digits of the time (milliseconds or finer)",
                  group="clock")

"""Units of a drafted map that one motion shows: specific force against the path, acceleration against velocity.

Both sides are integrated over the same number of rows, so that noise is small and a wrong unit of time shows, too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from scipy.ndimage import uniform_filter1d

from ..sources.column_map import UNITS
from ..units import factor
from . import column_evidence as evidence
from .draft import Draft, Key
from .draft_axes import rotation_of

SHORTEST_ROWS = 2
LONGEST_SHARE = 8
"""Rows that are integrated over: from the first number to this part of the table, doubled each time."""
AXES = 2
"""Axes that have to correlate at least."""
FORWARD_RIGHT_DOWN = np.array([1.0, -1.0, -1.0])


def judge_motion(draft: Draft, values: Mapping[str, np.ndarray], time_s: np.ndarray) -> None:
    """Asks where two descriptions of one motion differ in size."""
    steps = np.diff(time_s)
    if len(time_s) < 4 * evidence.WINDOW or not np.isfinite(steps).all() or not np.median(steps) > 0.0:
        return
    step_s = float(np.median(steps))
    for place, names in (("mocap", ("px", "py", "pz")), ("estimator", ("x", "y", "z"))):
        _force(draft, values, draft.columns(place, names), step_s)
    _acceleration(draft, values, step_s)


def _force(draft: Draft, values: Mapping[str, np.ndarray], path: list[Key], step_s: float) -> None:
    """The specific force, turned to the world, bends the path."""
    acc = draft.columns("imu", ("acc_x", "acc_y", "acc_z"))
    rotation = rotation_of(draft, values)
    if rotation is None or len(path) < 3 or len(acc) < 3:
        return
    p, f = draft.si(path, values), draft.si(acc, values)
    if not (np.isfinite(p).all() and np.isfinite(f).all()):
        return
    for force in (rotation.apply(f), rotation.apply(f * FORWARD_RIGHT_DOWN)):
        def of(rows: int, force: np.ndarray = force) -> evidence.Ratio:
            twice = uniform_filter1d(uniform_filter1d(force, rows, axis=0), rows, axis=0)
            bent = p[2 * rows:] - 2.0 * p[rows:-rows] + p[:-2 * rows]
            return evidence.ratio(bent, (rows * step_s) ** 2 * twice[rows:-rows])

        found = _first(of, len(p))
        if found is not None:
            if not found.agrees(1.0):
                shown = ", ".join(f"{r:.3g}" for r in found.known)
                gyro = draft.open_or_shown(draft.columns("imu", ("gyro_x", "gyro_y", "gyro_z")))
                draft.ask([*path, *acc, *gyro], f"the path bends {shown} times as strongly as the accelerometer "
                          "shows; write the unit of each, or of the time")
            return


def _acceleration(draft: Draft, values: Mapping[str, np.ndarray], step_s: float) -> None:
    """An estimated acceleration is the rate of the estimated velocity."""
    pairs = [(("estimator", f"v{a}"), ("estimator_acc", f"a{a}")) for a in "xyz"]
    pairs = [(v, a) for v, a in pairs if v in draft.mapped and a in draft.mapped]
    if not pairs:
        return
    speed, rate = draft.si([v for v, _ in pairs], values), draft.si([a for _, a in pairs], values)
    if not (np.isfinite(speed).all() and np.isfinite(rate).all()):
        return
    gained = step_s * np.cumsum(rate, axis=0)
    found = _first(lambda rows: evidence.ratio(gained[rows:] - gained[:-rows], speed[rows:] - speed[:-rows]),
                   len(speed), min(AXES, len(pairs)))
    if found is None:
        return
    keys = [a for _, a in pairs]
    still = draft.open(keys)
    fits = [u for u in UNITS["m/s^2"] if found.agrees(factor(draft.mapped[keys[0]].unit) / factor(u))]
    if fits and len(still) == len(keys):
        draft.set_unit(keys, fits[0], "it is the rate of the velocity")
    elif not found.agrees(1.0):
        shown = ", ".join(f"{r:.3g}" for r in found.known)
        draft.ask(keys, f"the acceleration is {shown} times the rate of the velocity; write the unit of each")


def _first(of: Callable[[int], evidence.Ratio], n: int, axes: int = AXES) -> evidence.Ratio | None:
    """The ratio over the fewest rows over which enough axes correlate. Over longer times small biases add up."""
    rows = SHORTEST_ROWS
    while rows <= n // LONGEST_SHARE:
        found = of(rows)
        if len(found.known) >= axes:
            return found
        rows *= 2
    return None

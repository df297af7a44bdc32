"""Velocities that are not the rate of the position in the same stream, axis by axis: one of both is another column.

Displacements over half a second are compared, so that noise is small.
"""

import numpy as np

from ..settings import number
from .airborne import airborne_spans
from .body_velocity import VELOCITY, body_velocities
from .context import Context
from .dropouts import alive_until
from .held_poses import POSITION
from .shared_frame import PLACE
from .stream_frames import stream_turns
from .usable_rows import advancing, usable_streams

WINDOW_S, STEP_S = 0.5, 0.05
FEWEST_WINDOWS = 40
LEAST_M = number("audit.path_velocity.least_m")
FOLLOWS = number("audit.path_velocity.follows")
RATIO = number("audit.path_velocity.factor")


def unrelated_velocities(context: Context) -> list[tuple[str, tuple[str, ...], str]]:
    """(stream, velocities, evidence) of each stream; none of one that is turned as a whole."""
    turned = {stream for stream, *_ in context.once(body_velocities)} | {
        turn.stream for turn in context.once(stream_turns)}
    found = []
    for name, place in (("mocap", POSITION), ("estimator", PLACE)):
        moved = None if name in turned else _displacements(context, name, place)
        seen = {} if moved is None else {VELOCITY[i]: f"{VELOCITY[i]} moves {of[1]:.2g} times as far as {place[i]} "
                                         f"(correlation {of[0]:+.2f})" for i in range(3)
                                         if (of := _relation(moved[0][:, i], moved[1][:, i])) is not None}
        if seen:
            found.append((name, tuple(seen), f"{', '.join(seen.values())}; velocity and position of {name} are of "
                                             "different axes or units"))
    return found


def _relation(by_place: np.ndarray, by_velocity: np.ndarray) -> tuple[float, float] | None:
    """Correlation and ratio of displacements (n,) that differ; None for those that are alike."""
    sizes = float(by_place.std()), float(by_velocity.std())
    if max(sizes) < LEAST_M:
        return None
    follows = float(np.mean((by_place - by_place.mean()) * (by_velocity - by_velocity.mean()))
                    / max(sizes[0] * sizes[1], 1e-12))
    ratio = sizes[1] / max(sizes[0], 1e-12)
    return (follows, ratio) if follows < FOLLOWS or not 1.0 / RATIO < ratio < RATIO else None


def _displacements(context: Context, name: str, place: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray] | None:
    """(n, 3) m each in the air, by position and by velocity; None where there are too few."""
    stream, spans = context.once(usable_streams).get(name), context.once(airborne_spans)
    if stream is None or not spans or not all(q in stream for q in (*place, *VELOCITY)):
        return None
    rows = np.isfinite(stream[[*place, *VELOCITY]]).all(axis=1) & advancing(stream.time_s) & (
        stream.time_s <= context.once(alive_until)[name])
    if rows.sum() < 2:
        return None
    t, path, velocity = stream.time_s[rows], stream[place][rows], stream[VELOCITY][rows]
    integral = np.vstack([np.zeros(3), np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * np.diff(t)[:, None], axis=0)])
    start = np.arange(max(t[0], spans[0].start_s), min(t[-1], spans[-1].end_s) - WINDOW_S, STEP_S)
    first, last = (np.searchsorted(t, at) for at in (start, start + WINDOW_S))
    whole = np.array([a < b and np.diff(t[a:b + 1]).max(initial=0.0) < 0.5 * WINDOW_S
                      for a, b in zip(first, last, strict=True)], dtype=bool)
    if whole.sum() < FEWEST_WINDOWS:
        return None
    first, last = first[whole], last[whole]
    return path[last] - path[first], integral[last] - integral[first]

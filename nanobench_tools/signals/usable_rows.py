"""The rows of each stream that can be worked with: timestamps that are numbers and advance."""

import numpy as np

from ..flight import Span, Stream
from .context import Context

POINTS_A_ROW = 100
"""Points of a grid between two rows, at most: timestamps in a smaller unit lie further apart."""


def advancing(time_s: np.ndarray) -> np.ndarray:
    """(n,) bool: finite timestamps later than every timestamp before them."""
    finite = np.isfinite(time_s)
    t = np.where(finite, time_s, -np.inf)
    latest = np.concatenate(([-np.inf], np.maximum.accumulate(t)[:-1])) if len(t) else t
    return np.asarray(finite & (t > latest))


def usable_streams(context: Context) -> dict[str, Stream]:
    """Every stream of the flight on strictly rising timestamps; values may still be NaN."""
    kept: dict[int, np.ndarray] = {}  # streams of one table share one array of timestamps
    result = {}
    for name, stream in context.flight.streams.items():
        key = id(stream.time_s)
        if key not in kept:
            kept[key] = advancing(stream.time_s)
        keep = kept[key]
        result[name] = stream if keep.all() else stream.rows(keep)
    return result


def runs(flags: np.ndarray) -> np.ndarray:
    """(m, 2) first and one-past-last index of every run of True in (n,) bool."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], np.asarray(flags, dtype=np.int8), [0]))))
    return edges.reshape(-1, 2)


def typical_step_s(time_s: np.ndarray) -> float:
    """Median distance of timestamps [s]; nan for fewer than two."""
    return float(np.median(np.diff(time_s))) if len(time_s) > 1 else float("nan")


def whole_span(context: Context) -> Span:
    """From the first to the last timestamp of any stream that is a number."""
    ends = [(float(s.time_s[0]), float(s.time_s[-1])) for s in context.once(usable_streams).values() if len(s)]
    return Span(min(a for a, _ in ends), max(b for _, b in ends)) if ends else Span(0.0, 0.0)


def even_grid(start_s: float, end_s: float, step_s: float, rows: int) -> np.ndarray:
    """(n,) times from ``start_s`` to ``end_s``; empty where so few rows lie there that they show no motion."""
    return np.arange(start_s, end_s, step_s) if end_s - start_s < POINTS_A_ROW * rows * step_s else np.empty(0)


def usual_step_s(time_s: np.ndarray) -> float:
    """Distance of timestamps that 95 % do not exceed [s]: ordinary where rows are irregular; nan for fewer than two."""
    return float(np.quantile(np.diff(time_s), 0.95)) if len(time_s) > 1 else float("nan")


def tables(context: Context) -> list[tuple[str, np.ndarray]]:
    """The different columns of timestamps of a flight (finite ones, as they are): stream name, empty when it is
    shared."""
    found: list[tuple[str, np.ndarray]] = []
    for name, stream in context.flight.streams.items():
        for i, (_, t) in enumerate(found):
            if t is stream.time_s or np.array_equal(t, stream.time_s, equal_nan=True):
                found[i] = ("", t)
                break
        else:
            found.append((name, stream.time_s))
    return [(name, t[np.isfinite(t)]) for name, t in found]


def coarse_tables(context: Context) -> list[tuple[str, np.ndarray]]:
    """Those of ``tables`` in which more than half of the rows repeat the timestamp before, with other values."""
    found = []
    for name, t in context.once(tables):
        same = np.flatnonzero(np.diff(t) == 0.0)
        if 2 * len(same) <= len(t):
            continue
        streams = [s for s in context.flight.streams.values() if np.array_equal(s.time_s[np.isfinite(s.time_s)], t)]
        if any((np.nan_to_num(s.values[same]) != np.nan_to_num(s.values[same + 1])).any(axis=1).mean() > 0.5
               for s in streams):
            found.append((name, t))
    return found

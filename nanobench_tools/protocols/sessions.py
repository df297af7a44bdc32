"""Sessions: recordings of one day's work, with one set of propellers, one calibration and one air.

They are found from the recordings' own timestamps. A session begins where a recording begins long after the one before.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from ..metrics.statistics import FEW_SESSIONS, Summary, session_count, why_not
from ..results.result import OPTIONAL, Result, to_json
from ..settings import number

SESSION_GAP_S = number("protocols.sessions.session_gap_s")

DATED_S = 946_684_800.0
"""Unix time of the year 2000: a smaller timestamp is of a clock that started with the vehicle, and no date."""


@dataclass(frozen=True)
class Sessions:
    """begins_s: Unix times at which sessions begin, rising; empty where no recording holds a date."""

    begins_s: tuple[float, ...] = ()

    @classmethod
    def of(cls, recordings: Iterable[Any]) -> Sessions:
        """Of all recordings of a run, each with ``epoch_s``. A recording keeps its session when groups are formed."""
        return cls.at([stamp_of(recording) for recording in recordings])

    @classmethod
    def at(cls, stamps_s: Sequence[float]) -> Sessions:
        """Of recordings that began at these timestamps."""
        known = np.unique([s for s in stamps_s if dated(s)])
        begins = [b for a, b in pairwise(known) if b - a > SESSION_GAP_S]
        return cls((float(known[0]), *map(float, begins)) if len(known) else ())

    def labels(self, recordings: Iterable[Any]) -> np.ndarray:
        """(n,) number of each one's session, -1 (UNKNOWN) for one without a date (or from before all sessions)."""
        return self.labels_at([stamp_of(recording) for recording in recordings])

    def by_name(self, flights: Iterable[Any]) -> dict[str, int]:
        """{name: label} of flights."""
        found = list(flights)
        return dict(zip([flight.name for flight in found], self.labels(found).tolist(), strict=True))

    def labels_at(self, stamps_s: Sequence[float]) -> np.ndarray:
        """``labels`` of recordings that began at these timestamps."""
        stamps = np.array([s if dated(s) else -np.inf for s in stamps_s])
        return np.searchsorted(np.array(self.begins_s), stamps, side="right") - 1


def stamp_of(recording: Any) -> float:
    """Unix time [s] of its start; 0 if unknown, as for a thrust-stand table."""
    return float(getattr(recording, "epoch_s", 0.0))


def dated(stamp_s: float) -> bool:
    """Whether a timestamp is a date rather than the time since a vehicle started."""
    return bool(np.isfinite(stamp_s)) and stamp_s >= DATED_S


def labels_of(recordings: Sequence[Any], sessions: Sessions | None = None) -> np.ndarray:
    """(n,) sessions of ``recordings`` among those of the run; of themselves alone where none are given."""
    return (sessions or Sessions.of(recordings)).labels(recordings)


def sessions_of(recordings: Sequence[Any]) -> dict[str, int]:
    """{name: label} of recordings among themselves alone."""
    return Sessions.of(recordings).by_name(recordings)


@dataclass(frozen=True, repr=False)
class Drawn(Result):
    """Basis of a row's intervals: the number of sessions of its flights, and the design effect of each metric (in Task
    1 by horizon). Also the reason for missing or unreliable intervals (empty without one)."""

    sessions: int | None
    design_effect: Mapping[str, float | Mapping[str, float | None] | None]
    ci_why: str = field(default="", metadata=OPTIONAL)

    @classmethod
    def of(cls, labels: np.ndarray | Sequence[int], metrics: Mapping[str, Summary]) -> Drawn:
        """Of a row over flights of these sessions, from its summaries."""
        return cls(session_count(labels), {name: found.design_effect for name, found in metrics.items()},
                   why_not(len(labels), labels))


def interval_note(rows: Iterable[Any], metrics: Sequence[str] = ()) -> str:
    """Notes on the intervals of a table and their reliability. They describe the one of its ``rows`` (results, or the
    content of their files) with most flights, over ``metrics`` (empty: all). Empty for rows without sessions (old
    results)."""
    rows = [row for row in to_json(list(rows)) if "sessions" in row]
    most = max((_flights(row) for row in rows), default=0)
    widest = [row for row in rows if _flights(row) == most]
    if not widest:
        return ""
    found, why = widest[0]["sessions"], str(widest[0].get("ci_why") or "")
    if most < 2 or found == 1:
        return f"No 95 % interval: {why}."
    if found is None:
        return f"95 % intervals: {why}." if why else "95 % intervals over independent draws."
    text = f"95 % intervals: bootstrap of {found} sessions, then of flights within them"
    text += f"; {why.partition(': ')[2]} (fewer than {FEW_SESSIONS})." if why else "."
    effects = [e for row in widest for e in _effects(row.get("design_effect") or {}, metrics)]
    if effects and max(effects) > 1.0:
        low, high = (f"{np.sqrt(e):.1f}" for e in (min(effects), max(effects)))
        factor = low if low == high else f"{low} to {high}"
        alike = [c for row in widest for c in _correlations(row, metrics)]
        ends = list(dict.fromkeys(f"{c:.2f}" for c in (min(alike), max(alike)))) if alike else []
        correlation = f"intra-class correlation {' to '.join(ends)}; " if ends else ""
        text += (f" Over flights alone they would have to be {factor} times as wide, since flights of a session are "
                 f"alike ({correlation}square root of the design effect).")
    return text


def short_note(rows: Iterable[Any]) -> str:
    """``interval_note`` without what it says of design effects."""
    text = interval_note(rows).partition(" Over flights alone")[0]
    return text.replace(": the difference between sessions is unknown", "")


def parameters_note(labels: np.ndarray) -> str:
    """What the intervals of fitted parameters are: refits to drawn training flights; labels: sessions of these."""
    n, found = len(labels), session_count(labels)
    if n < 2:
        return ""
    if found is None:
        return f"Intervals of parameters draw {n} training flights alone: their sessions are unknown."
    if found == 1:
        return f"No interval of parameters: {n} training flights of {why_not(n, labels)}."
    most = np.unique(labels, return_counts=True)[1].max()
    few = f"; {found} sessions: too narrow to trust" if found < FEW_SESSIONS else ""
    return (f"Intervals of parameters draw {found} sessions, then flights within them ({n} training flights, {most} of "
            f"one session){few}.")


def _flights(row: Mapping[str, Any]) -> int:
    return int(row.get("n_flights", row.get("files", row.get("n"))) or 0)


def _correlations(row: Mapping[str, Any], metrics: Sequence[str]) -> list[float]:
    found = row.get("statistics") or row.get("metrics") or {}
    parts = [value.get("intra_class") for name, value in found.items()
             if isinstance(value, Mapping) and (not metrics or name in metrics)]
    return [float(v) for v in parts if v is not None]


def _effects(found: Mapping[str, Any], metrics: Sequence[str]) -> list[float]:
    """The design effects of ``metrics``, those at several horizons too."""
    parts = [value for name, value in found.items() if not metrics or name in metrics]
    flat = [v for part in parts for v in (part.values() if isinstance(part, Mapping) else [part])]
    return [float(v) for v in flat if v is not None]

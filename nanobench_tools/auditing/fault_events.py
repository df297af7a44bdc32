"""Faults of one recording as events: one event for what a person would describe as one thing, over streams and
repetitions.

An end of the log on the ground is one fault per stream and one event. So is a clock that moves under all of them.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from ..flight import Fault, Span, intersect_spans, merge_spans
from ..results.result import Result
from .faults.kind import FaultKind
from .faults.kinds import kinds
from .faults.making import OR, SINCE

MOST_NAMES = 4
"""Maximum number of streams or columns listed by name; beyond it, their number is given."""


@dataclass(frozen=True, repr=False)
class FaultEvent(Result):
    """``kind``: name of the kind of fault; ``streams``: in which it was found, ("",) for the whole recording;
    ``spans``: where, in s from the first row; ``sentence``: description of the fault; ``advice``: what to do;
    ``faults``: how many faults it merges; ``seconds_cut``: how much of the flight it takes away."""

    kind: str
    streams: tuple[str, ...]
    spans: tuple[Span, ...]
    sentence: str
    advice: str
    faults: int
    seconds_cut: float

    @property
    def information(self) -> bool:
        """Whether it is worth knowing and nothing is wrong."""
        kind = kinds().get(self.kind)
        return kind is None or kind.group == "information"


def events_of(faults: Iterable[Fault], airborne: Sequence[Span] = ()) -> tuple[FaultEvent, ...]:
    """The events of ``faults``: first those that remove most of the flight, then corrected ones, then the rest.

    ``airborne``: time in the air, for the removed part of it; empty: of the whole recording. Kinds that rates and
    numbers of samples show already (``in_overview``) make no event.
    """
    groups: dict[tuple[str, str], list[Fault]] = {}  # by kind, and by stream or the open question
    known = kinds()
    for fault in faults:
        kind = known.get(fault.kind)
        if kind is not None and kind.in_overview:
            place = fault.evidence if OR in fault.evidence else "" if kind.merges else fault.stream
            groups.setdefault((fault.kind, place), []).append(fault)
    events = [_event(known[name], found, airborne) for (name, _), found in groups.items()]
    return tuple(sorted(events, key=lambda e: (e.information, -e.seconds_cut, not known[e.kind].corrected,
                                               e.spans[0].start_s, e.kind)))


def _event(kind: FaultKind, faults: Sequence[Fault], airborne: Sequence[Span]) -> FaultEvent:
    spans = merge_spans(f.span for f in faults) or (faults[0].span,)
    cut = intersect_spans(spans, airborne) if airborne else spans
    text = kind.told.format_map(_words(kind, faults, spans, airborne)) if kind.told else kind.sentence.rstrip(".")
    advice, undecided = kind.advice, OR in faults[0].evidence
    if undecided:
        text, advice = faults[0].evidence, f"find out which of them it is, then {kind.advice}"
    return FaultEvent(kind.name, tuple(dict.fromkeys(f.stream for f in faults)), spans, text, advice, len(faults),
                      sum(s.duration_s for s in cut) if kind.cuts else 0.0)


def _words(kind: FaultKind, faults: Sequence[Fault], spans: Sequence[Span], airborne: Sequence[Span]
           ) -> Mapping[str, str]:
    """What a sentence of a kind may ask for."""
    streams = [s for s in dict.fromkeys(f.stream for f in faults) if s]
    columns = list(dict.fromkeys(c for f in faults for c in f.columns))
    rows = sum(f.size for f in faults if f.unit in ("rows", "cells") and math.isfinite(f.size))
    return {
        "streams": _listed(streams, "streams") or "the recording",
        "columns": _listed(columns, "columns") or "values",
        "evidence": "; ".join(dict.fromkeys(f.evidence.partition(SINCE)[0] for f in faults)),
        "s": "s" if len(streams) == 1 else "",
        "is": "is" if len(columns) == 1 else "are",
        "its": "its" if len(columns) == 1 else "their",
        "count": _count(rows, faults[0].unit) if rows else _times(len(spans)),
        "seconds": f"{sum(s.duration_s for s in spans):.2g} s",
        "size": size_in_words(_largest(faults), faults[0].unit),
        "degrees": _degrees(_largest(faults)),
        "factor": size_in_words(_largest(faults), ""),
        "lateness": _lateness(faults),
        "at": f"{spans[0].start_s:.1f} s",
        "where": "in the air" if any(a.start_s < spans[0].start_s < a.end_s for a in airborne) else "on the ground",
    }


def size_in_words(size: float, unit: str) -> str:
    """A size with its unit, small times in ms and small lengths in mm."""
    if not math.isfinite(size):
        return "an unknown amount"
    if unit in ("s", "m") and abs(size) < 1.0:
        return f"{1e3 * size:.3g} m{unit}"
    if unit == "s/s":
        return f"{1e3 * size:.2g} ms a second"
    return f"{size:.3g}" + (f" {unit}" if unit not in ("", "1") else "")


def _degrees(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.0f} deg" if math.isfinite(angle_rad) else "an unknown angle"


def _largest(faults: Sequence[Fault]) -> float:
    return max((f.size for f in faults if math.isfinite(f.size)), key=abs, default=math.nan)


def _lateness(faults: Sequence[Fault]) -> str:
    """``12 ms late`` or ``12 to 20 ms late``. For offsets on both sides of zero: ``-4 to 20 ms late``."""
    sizes = [1e3 * f.size for f in faults if math.isfinite(f.size)]
    if not sizes:
        return "late or early"
    if max(sizes) < 0:
        sizes, word = [-x for x in sizes], "early"
    else:
        word = "late"
    low, high = round(min(sizes)), round(max(sizes))
    return f"{high} ms {word}" if low == high else f"{low} to {high} ms {word}"


def _count(n: float, unit: str) -> str:
    return f"{n:.0f} {unit[:-1] if n == 1 else unit}"


def _times(n: int) -> str:
    return "once" if n == 1 else "twice" if n == 2 else f"{n} times"


def _listed(names: Sequence[str], what: str) -> str:
    if len(names) > MOST_NAMES:
        return f"{len(names)} {what}"
    return names[0] if len(names) == 1 else " and ".join([", ".join(names[:-1]), names[-1]]) if names else ""

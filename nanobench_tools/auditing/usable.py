"""Which recordings a task can use, with their unusable rows taken out, and why the others are left out."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..flight import Flight, Span, Stream, intersect_spans, poses_alone
from ..results.fitted_values import LeftOut
from .faults.kinds import cutting
from .recording_audit import Audit
from .selection import distinct

POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
MOCAP = (*POSE, "vx", "vy", "vz")
MOTORS = ("m1", "m2", "m3", "m4")

SHORTEST_S = 0.5
"""A flight with less left than 50 rows at 100 Hz, or one window of prediction, is not scored."""

OWN_TIME = "give every row its own time"

Needed = Mapping[str, Sequence[str]]
"""Stream -> quantities a task cannot do without. ``a|b`` as the name of a stream means one of both."""


def missing(flight: Flight, needed: Needed) -> str | None:
    """What a recording lacks, in words; None if nothing."""
    for names, quantities in needed.items():
        present = [name for name in names.split("|") if name in flight]
        if not present:
            return f"no {names.replace('|', ' or ')} stream"
        lacking = [q for q in quantities if q not in flight[present[0]]]
        if lacking:
            return f"no {', '.join(lacking)} in the {present[0]} stream"
        if len(flight[present[0]]) < 2:
            return f"no readable rows in the {present[0]} stream"
    return None if "stand" in needed else stuck_clock(flight, needed)  # what stands still needs no clock


def stuck_clock(flight: Flight, needed: Needed) -> str | None:
    """In words, that most rows of a needed stream carry the timestamp of another row; None if no stream is so.

    Streams of one table share its time column: the first that is found is named.
    """
    for name in dict.fromkeys(part for names in needed for part in names.split("|") if part in flight):
        time_s = flight[name].time_s
        repeated = len(time_s) - len(np.unique(time_s))
        if repeated > len(time_s) / 2:
            return (f"the time column repeats itself, {repeated} of {len(time_s)} rows of the {name} stream carry the "
                    f"timestamp of another (coarse_time); {OWN_TIME}")
    return None


def usable(flights: Iterable[Flight], audits: Iterable[str], needed: Needed) -> list[Flight]:
    """The flights that were audited and have what is needed, tidied; in the order given."""
    known = set(audits)
    tidied = (tidy(f, needed) for f in flights if f.name in known and missing(f, needed) is None)
    return [f for f in tidied if missing(f, needed) is None]


def tidy(flight: Flight, needed: Needed) -> Flight:
    """The flight without rows of the needed streams that hold no number or whose timestamps do not rise.

    Interpolation needs rising timestamps; such rows are faults of the recording, which the audit lists. The flight
    itself without any.
    """
    streams = {}
    for name in {part for names in needed for part in names.split("|")} & set(flight.streams):
        good = _good_rows(flight[name])
        if not good.all():
            streams[name] = flight[name].rows(good)
    return replace(flight, streams={**flight.streams, **streams}) if streams else flight


def _good_rows(stream: Stream) -> np.ndarray:
    """(n,) bool: all values finite, and later than every finite timestamp before."""
    time_s = np.where(np.isfinite(stream.time_s), stream.time_s, -np.inf)
    before = np.concatenate([[-np.inf], np.maximum.accumulate(time_s)[:-1]])
    return np.asarray(np.isfinite(stream.values).all(axis=1) & (time_s > before))


def left_out(flights: Sequence[Flight], used: Iterable[str], audits: Mapping[str, Audit] | Iterable[str],
             needed: Needed, reasons: Mapping[str, str] | None = None) -> list[LeftOut]:
    """Every recording that no row counts; ``used`` are the names that rows count.

    reasons: by name, where the caller knows why; the faults that cut a flight come from ``audits`` that hold verdicts.
    """
    used, known, reasons = set(used), set(audits), reasons or {}
    repeats = {r.flight.name: f"{r.kind} of {r.of.name}" for r in distinct(flights)[1]}
    found = []
    for flight in flights:
        if flight.name in used:
            continue
        verdict = audits.get(flight.name) if isinstance(audits, Mapping) else None
        reason = ("the audit failed" if flight.name not in known else reasons.get(flight.name)
                  or missing(flight, needed) or missing(tidy(flight, needed), needed) or repeats.get(flight.name)
                  or (cut_by(verdict, needed) if verdict is not None else None)
                  or "no rows to score: never in the air, too short, or not requested")
        found.append(LeftOut(flight.name, reason))
    return found


def flown(flight: Flight, audit: Audit) -> tuple[Span, ...]:
    """Where it was in the air; all of a recording of poses alone in a body frame that does not show it."""
    alone = poses_alone(flight) and all(fault.kind != "never_flew" for fault in audit.faults)
    return audit.airborne or ((audit.span,) if alone else ())


def cut_by(audit: Audit, needed: Needed) -> str | None:
    """The faults that leave less than SHORTEST_S of a flight in the needed streams, in words; None if more is left, or
    it was not in the air that long. The whole recording counts if the truth does not show when it flew."""
    streams = {part for names in needed for part in names.split("|")}
    flight = audit.airborne or (audit.span,)
    flown = sum(span.duration_s for span in flight)
    left = sum(span.duration_s for span in intersect_spans(flight, audit.clean_for(streams)))
    if flown < SHORTEST_S or left >= SHORTEST_S:
        return None
    cuts = cutting()
    kinds = dict.fromkeys(f"{fault.kind} of {fault.stream or 'all streams'}" for fault in audit.faults
                          if fault.kind in cuts and fault.stream in {*streams, ""}
                          and intersect_spans([fault.span], flight))
    return f"cut by {', '.join(kinds)}"

"""One verdict on one recording: how much of the flight is usable, how bad it is, what is wrong in words, what to do."""

from dataclasses import dataclass
from typing import Any, Literal

from ..flight import Flight, Span, intersect_spans, subtract_spans
from ..results.result import Result, to_json
from .fault_events import FaultEvent, events_of
from .faults.kinds import cutting, kinds
from .flight_health import health_of
from .recording_audit import Audit
from .verb_needs import can

Severity = Literal["fine", "minor", "cut", "unusable"]
MINOR_SHARE = 0.05
"""A flight of which no larger share is cut is ``minor``, of which more is cut ``cut``: a convention."""
SHORTEST_S = 1.0
"""Without a usable stretch of this length a recording is ``unusable``: a convention."""
MOST_EVENTS = 2
"""Events in the sentence; the others are in the list."""


@dataclass(frozen=True, repr=False)
class AuditVerdict(Result):
    """
    - sentence: one line to read.
    - usable: the flight (the recording, where the time of flight is unknown) without the faults that cut, in s from
      the first row.
    - unfit: streams that a fault spoils from end to end;

    ``usable`` is of the others. severity: ``fine``; ``minor`` (corrected, or next to nothing is cut); ``cut``;
    ``unusable``.
    """

    flight: str
    sentence: str
    severity: Severity
    usable: tuple[Span, ...]
    usable_s: float
    flight_s: float
    unfit: tuple[str, ...]
    events: tuple[FaultEvent, ...]

    @property
    def advice(self) -> str:
        """What to do about the first event that something can be done about; what cuts is left out anyhow."""
        return next((e.advice for e in self.events if e.advice and not e.information), "")


def verdict_of(audit: Audit) -> AuditVerdict:
    """The verdict of an audit. Pure."""
    events = events_of(audit.faults, audit.airborne)
    flown = audit.airborne or (audit.span,)
    whole = {f.stream for f in audit.faults if f.kind in cutting() and kinds()[f.kind].whole}
    clean = audit.clean if not whole else audit.clean_for({*audit.rates} - whole)
    grounded = any(e.kind == "never_flew" for e in events)
    usable = () if grounded or "" in whole or "mocap" in whole else intersect_spans(flown, clean)
    flight_s, usable_s = _total(flown), _total(usable)
    severity = _severity(usable, flight_s, whole, events)
    sentence = _sentence(severity, usable_s, 0.0 if grounded else flight_s, bool(audit.airborne), events)
    if audit.lost_link:
        sentence = f"{sentence}; {audit.lost_link}"
        severity = "minor" if severity == "fine" else severity
    return AuditVerdict(audit.flight, sentence, severity, usable, usable_s, flight_s, tuple(sorted(whole)), events)


def _severity(usable: tuple[Span, ...], flight_s: float, unfit: set[str], events: tuple[FaultEvent, ...]) -> Severity:
    if max((s.duration_s for s in usable), default=0.0) < SHORTEST_S:
        return "unusable"
    if unfit or flight_s - _total(usable) > MINOR_SHARE * flight_s:
        return "cut"
    wrong = any(not e.information and (e.seconds_cut or not kinds()[e.kind].cuts) for e in events)
    return "minor" if wrong else "fine"


def _sentence(severity: Severity, usable_s: float, flight_s: float, flew: bool, events: tuple[FaultEvent, ...]) -> str:
    told = [e for e in events if not e.information and (e.seconds_cut or not kinds()[e.kind].cuts)]
    what = "flight" if flew else "recording"
    head = ("not usable" if severity == "unusable" else f"all {usable_s:.1f} s of {what} usable"
            if usable_s > flight_s - 0.05 else f"{usable_s:.1f} of {flight_s:.1f} s of {what} usable")
    if not told:
        return head if severity != "unusable" else f"{head}: {flight_s:.1f} s of {what} are too short"
    more = len(told) - MOST_EVENTS
    return f"{head}: " + "; ".join(e.sentence for e in told[:MOST_EVENTS]) + (f"; and {more} more" if more > 0 else "")


def _total(spans: tuple[Span, ...]) -> float:
    return sum(s.duration_s for s in subtract_spans(spans, ()))


def entry_of(flight: Flight, audit: Audit) -> dict[str, Any]:
    """The flight's entry in audit.json: the audit, and what a person asks first."""
    verdict = verdict_of(audit)
    return {"flight": audit.flight, "verdict": verdict.sentence, "severity": verdict.severity,
            "advice": verdict.advice, "usable": [[s.start_s, s.end_s] for s in verdict.usable],
            "unfit": list(verdict.unfit), "can": can(flight, audit),
            "health": to_json(health_of(flight, audit)), **audit.to_json(),
            "assumptions": [vars(a) for a in flight.provenance.assumptions],
            "events": [{"kind": e.kind, "streams": list(e.streams), "spans": [[s.start_s, s.end_s] for s in e.spans],
                        "sentence": e.sentence, "advice": e.advice, "faults": e.faults, "seconds_cut": e.seconds_cut}
                       for e in verdict.events]}

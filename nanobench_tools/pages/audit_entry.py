"""What the page asks of one recording's audit (its entry in audit.json)."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..auditing.faults.kinds import cutting, log_ended, those
from ..flight import Span, intersect_spans, merge_spans

CLOCK_STREAMS = ("imu", "attitude_qw", "attitude", "estimator")
"""Streams whose clock offset stands for the recording, the first that there is."""

def total(spans: Iterable[Iterable[float]] | None) -> float | None:
    """Seconds covered by [[start, end], ...]; None when there is no such list."""
    return None if spans is None else sum(s.duration_s for s in merge_spans(Span(*s) for s in spans))


def span_of(flight: Mapping[str, Any]) -> Span | None:
    """First to last timestamp; from the ends of everything known when the entry does not say."""
    if flight.get("span"):
        return Span(*flight["span"])
    times = [t for s in [*(flight.get("clean") or []), *(flight.get("airborne") or [])] for t in s]
    times += [t for f in flight.get("faults") or [] for t in (f["start_s"], f["end_s"])]
    return Span(0.0, max(times)) if times else None


def cut_spans(flight: Mapping[str, Any], stream: str) -> tuple[Span, ...]:
    """Where ``stream`` must not be used: its cutting faults and those of the whole recording."""
    kinds = cutting()
    return merge_spans(Span(f["start_s"], f["end_s"]) for f in flight.get("faults") or []
                       if f["kind"] in kinds and f["stream"] in (stream, ""))


def share_valid(flight: Mapping[str, Any], stream: str) -> float | None:
    """Share of the recording's time in which nothing is known against ``stream`` (0..1)."""
    span = span_of(flight)
    if span is None or span.duration_s <= 0:
        return None
    return max(0.0, 1.0 - sum(s.duration_s for s in cut_spans(flight, stream)) / span.duration_s)


def share_clean(flight: Mapping[str, Any]) -> float | None:
    """Share of the recording's time that is clean in every stream (0..1)."""
    span = span_of(flight)
    clean = total(flight.get("clean"))
    return None if span is None or clean is None or span.duration_s <= 0 else min(1.0, clean / span.duration_s)


def fault_counts(flight: Mapping[str, Any]) -> dict[str, int]:
    """Number of faults by kind, the most time-consuming kinds first; information is left out."""
    information = those(lambda kind: kind.group == "information")
    seconds: dict[str, float] = {}
    counts: dict[str, int] = {}
    for fault in flight.get("faults") or []:
        kind = fault["kind"]
        if kind not in information:
            counts[kind] = counts.get(kind, 0) + 1
            seconds[kind] = seconds.get(kind, 0.0) + fault["end_s"] - fault["start_s"]
    return dict(sorted(counts.items(), key=lambda item: (-seconds[item[0]], item[0])))


def streams_of(flights: Iterable[Mapping[str, Any]]) -> list[str]:
    """Every stream that any recording has, in the order met."""
    found: dict[str, None] = {}
    for flight in flights:
        found.update(dict.fromkeys(flight.get("rates") or {}))
    return list(found)


def lost_in_the_air(flight: Mapping[str, Any]) -> float:
    """Seconds of flight after the first stream died: what the file holds of it then is not from the vehicle."""
    kinds = log_ended()
    dead = merge_spans(Span(f["start_s"], f["end_s"]) for f in flight.get("faults") or [] if f["kind"] in kinds)
    airborne = [Span(*s) for s in flight.get("airborne") or []]
    return sum(s.duration_s for s in intersect_spans(airborne, dead))


def clock_points(flight: Mapping[str, Any]) -> Sequence[Sequence[float]]:
    """[t, d, sd] in s of the moving clock error of the first stream that has one; empty without."""
    clocks = flight.get("clock") or {}
    return next((clocks[s]["warp"] for s in CLOCK_STREAMS if (clocks.get(s) or {}).get("warp")), ())

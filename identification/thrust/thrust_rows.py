"""From recordings to rows: stand series and flights apart, and what was left out with its reason."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

from nanobench_tools.auditing.recording_audit import Audit
from nanobench_tools.auditing.usable import left_out, usable
from nanobench_tools.auditing.verb_needs import THRUST
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, Span, intersect_spans
from nanobench_tools.protocols.phases import flown_spans

from .flight_rows import Flown, fly
from .stand_series import Stand, is_stand, read_stand

STREAMS = tuple(THRUST)
Case = tuple[Flight, Sequence[Span]]
"""A flight with its clean airborne spans."""

AnyFile = TypeVar("AnyFile", Stand, Flown)


@dataclass
class Rows(Generic[AnyFile]):
    """What can be fitted or scored. reasons: by name of the recordings that cannot."""

    files: list[AnyFile] = field(default_factory=list)
    reasons: dict[str, str] = field(default_factory=dict)


def sort_out(flights: Iterable[Flight]) -> tuple[list[Flight], list[Flight]]:
    """(stand series, flights), in the order given."""
    flights = list(flights)
    return [f for f in flights if is_stand(f)], [f for f in flights if not is_stand(f)]


def stand_rows(recordings: Sequence[Flight]) -> Rows[Stand]:
    """Series that can be fitted; of byte-identical files the first. Among series with battery voltage, one without
    would remove every map with the voltage from all of them."""
    found: Rows[Stand] = Rows()
    seen: dict[str, str] = {}
    for recording in recordings:
        try:
            stand = read_stand(recording)
        except InputError as error:
            found.reasons[recording.name] = _without_place(error)
            continue
        if stand.sha256 and stand.sha256 in seen:
            found.reasons[recording.name] = f"copy of {seen[stand.sha256]}"
            continue
        seen[stand.sha256] = stand.name
        found.files.append(stand)
    if any(stand.battery_V is not None for stand in found.files):
        without = {s.name: "no battery voltage, which the other series have" for s in found.files
                   if s.battery_V is None}
        found.files = [s for s in found.files if s.name not in without]
        found.reasons |= without
    return found


def cases_of(flights: Sequence[Flight],
             audits: Mapping[str, Audit]) -> tuple[list[Case], dict[str, str]]:
    """(flights with their clean airborne spans, reasons of those without)."""
    reasons = {entry.flight: entry.reason for entry in left_out(flights, (), audits, THRUST)}
    cases: list[Case] = []
    for flight in usable(flights, audits, THRUST):
        audit = audits[flight.name]
        spans = intersect_spans(flown_spans(flight, audit.airborne), audit.clean_for(STREAMS))
        if spans:
            cases.append((flight, spans))
            reasons.pop(flight.name, None)
    return cases, reasons


def flown_rows(cases: Sequence[Case], delay_s: float) -> Rows[Flown]:
    """Flights at one delay of the inputs."""
    found: Rows[Flown] = Rows()
    for flight, spans in cases:
        try:
            found.files.append(fly(flight, spans, delay_s))
        except InputError as error:
            found.reasons[flight.name] = _without_place(error)
    return found


def fit_to_fly(cases: Sequence[Case]) -> list[Case]:
    """The cases that give rows at any delay."""
    good = {f.name for f in flown_rows(cases, 0.0).files}
    return [case for case in cases if case[0].name in good]


def load(sources: Iterable[Flight | str | Path]) -> tuple[list[Flight], dict[str, Audit]]:
    """Recordings and audits of ``sources``: flights as they are, paths (files, folders) read. InputError for a path
    that cannot be read."""
    from nanobench_tools.auditing.recording_audit import audit
    from nanobench_tools.sources.discover import load_recordings

    given = list(sources)
    flights = [s for s in given if isinstance(s, Flight)]
    if paths := [Path(s) for s in given if not isinstance(s, Flight)]:
        for path in paths:
            if not path.exists():
                raise InputError(str(path), "does not exist")
        loaded = load_recordings(paths)
        if loaded.failed:
            raise InputError(str(loaded.failed[0]["path"]), str(loaded.failed[0]["error"]))
        flights += loaded.flights
    return flights, {f.name: audit(f) for f in flights if not is_stand(f)}


def _without_place(error: InputError) -> str:
    return error.found + (f"; {error.advice}" if error.advice else "")

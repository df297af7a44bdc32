"""The audit of many flights through the runner."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ..auditing.faults.kinds import kinds
from ..auditing.recording_audit import Audit, audit, find_copies, with_copies
from ..flight import Flight
from ..signals.context import Context
from ..time_offsets.moving.apply import time_offset_of
from ..time_offsets.moving.time_offset import TimeOffset
from .clocks import Choice, TimeOffsets
from .identity import PACKAGES, method_identity
from .items import make_item
from .progress import Progress
from .runner import run_items


@dataclass(frozen=True)
class Audited:
    """``audits``: name of the flight -> verdict, failed ones left out. ``copies``: groups of names of equal recordings.
    ``failed``: [{item, file, error}]. ``time_offsets``: found for ``clocks`` together with the audits, for
    ``on_clock``."""

    audits: dict[str, Audit]
    copies: list[list[str]]
    failed: list[dict[str, str]]
    time_offsets: TimeOffsets = field(default_factory=dict)


def foreign_kinds() -> list[str]:
    """What other people's kinds of faults are made of; a verdict depends on them as on our own source."""
    return [f"{name} {method_identity(kind.find)}" for name, kind in kinds().items()
            if kind.find.__module__.partition(".")[0] not in PACKAGES]


@dataclass(frozen=True)
class AuditOnClocks:
    """One audit, and what to take out for each of some clocks."""

    audit: Audit
    time_offsets: tuple[TimeOffset | None, ...]


def audit_item(flight: Flight) -> Audit:
    """One audit."""
    return audit(flight)


def audit_and_clocks_item(flight: Flight, clocks: Sequence[Choice]) -> AuditOnClocks:
    """One audit and its ``clocks``; shared signals are derived once."""
    context = Context(flight)
    return AuditOnClocks(audit(flight, context), tuple(time_offset_of(context, *choice) for choice in clocks))


def audit_flights(flights: Sequence[Flight], store_dir: Path | None = None, jobs: int = 1,
                  scheduler: str | None = None, progress: Progress | None = None, clocks: Sequence[Choice] = (),
                  moved: Collection[str] = ()) -> Audited:
    """Audits ``flights`` (names unique) as ``run_items`` does; the same result for any ``jobs``. Recordings named in
    ``moved`` are put on ``clocks`` on the way, which takes half of what it takes afterwards."""
    others = foreign_kinds()
    work = [(audit_and_clocks_item, {"flight": flight, "clocks": tuple(clocks)}) if clocks and flight.name in moved else
            (audit_item, {"flight": flight}) for flight in flights]
    items = [make_item(function, given, f"audit {flight.name}", others)
             for flight, (function, given) in zip(flights, work, strict=True)]
    result = run_items(items, store_dir, jobs, scheduler, progress, "audit")
    read: list[tuple[Flight, Audit]] = []
    time_offsets: dict[tuple[str, Choice], TimeOffset | None] = {}
    for flight, item in zip(flights, items, strict=True):
        if item.key not in result.values:
            continue
        value = result.values[item.key]
        if isinstance(value, AuditOnClocks):
            time_offsets |= {(flight.name, choice): found
                             for choice, found in zip(clocks, value.time_offsets, strict=True)}
            value = value.audit
        read.append((flight, value))
    marked = with_copies([verdict for _, verdict in read], [flight for flight, _ in read])
    return Audited({verdict.flight: verdict for verdict in marked}, find_copies(flights), result.failed, time_offsets)

"""The audit of many flights through the runner."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..audit import Audit, audit, find_copies, with_copies
from ..faults.kinds import kinds
from ..flight import Flight
from .identity import PACKAGES, method_identity
from .items import make_item
from .progress import Progress
from .runner import run_items


@dataclass(frozen=True)
class Audited:
    """audits: name of the flight -> verdict, failed ones left out; copies: groups of names of equal recordings;
    failed: [{item, file, error}]."""

    audits: dict[str, Audit]
    copies: list[list[str]]
    failed: list[dict[str, str]]


def foreign_kinds() -> list[str]:
    """What other people's kinds of faults are made of; a verdict depends on them as on our own source."""
    return [f"{name} {method_identity(kind.find)}" for name, kind in kinds().items()
            if kind.find.__module__.partition(".")[0] not in PACKAGES]


def audit_item(flight: Flight) -> dict:
    """One audit as JSON."""
    return audit(flight).to_json()


def audit_flights(flights: Sequence[Flight], store_dir: Path | None = None, jobs: int = 1,
                  scheduler: str | None = None, progress: Progress | None = None) -> Audited:
    """Audits ``flights`` (names unique) as ``run_items`` does; the same result for any ``jobs``."""
    others = foreign_kinds()
    items = [make_item(audit_item, {"flight": flight}, f"audit {flight.name}", others) for flight in flights]
    result = run_items(items, store_dir, jobs, scheduler, progress, "audit")
    read = [(flight, Audit.from_json(result.values[item.key]))
            for flight, item in zip(flights, items, strict=True) if item.key in result.values]
    marked = with_copies([verdict for _, verdict in read], [flight for flight, _ in read])
    return Audited({verdict.flight: verdict for verdict in marked}, find_copies(flights), result.failed)

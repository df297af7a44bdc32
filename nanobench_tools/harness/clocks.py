"""Many flights on another clock, through the runner: found once per content, then from the store."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..audit import Audit
from ..flight import Flight
from ..retiming.apply import apply_warp, find_warp
from ..retiming.time_offset import ClockWarp
from ..retiming.votes import AS_RECORDED, evidence_of, voters
from .items import make_item
from .progress import Progress
from .runner import run_items


@dataclass(frozen=True)
class OnClock:
    """flights and audits as seen with the clock; warps: name of the flight -> what was taken out, None where nothing
    could be identified (such flights are as recorded); failed: [{item, file, error}]."""

    flights: list[Flight]
    audits: dict[str, Audit]
    warps: dict[str, ClockWarp | None]
    failed: list[dict[str, str]]

    @property
    def evidence(self) -> list[str]:
        """The kinds of streams that had a vote in any of the warps."""
        return evidence_of(self.flights)


def warp_item(flight: Flight, clock: str, judged: tuple[str, ...]) -> dict[str, Any]:
    """One warp as JSON; empty when there is none."""
    warp = find_warp(flight, clock, judged)
    return {} if warp is None else warp.to_json()


def on_clock(flights: Sequence[Flight], audits: Mapping[str, Audit], clock: str, judged: Sequence[str] = (),
             store_dir: Path | None = None, jobs: int = 1, scheduler: str | None = None,
             progress: Progress | None = None) -> OnClock:
    """``flights`` (those with an audit) and their audits on ``clock`` (``retiming.votes.CLOCKS``), where
    ``judged`` logged estimates are judged."""
    voices = tuple(sorted(judged))
    voters(clock, voices)  # an impossible choice is said before anything is computed
    audited = [f for f in flights if f.name in audits]
    if clock == AS_RECORDED:
        return OnClock(audited, dict(audits), {f.name: None for f in audited}, [])
    items = [make_item(warp_item, {"flight": f, "clock": clock, "judged": voices},
                       f"{clock} {f.name}") for f in audited]
    result = run_items(items, store_dir, jobs, scheduler, progress, clock)
    warps: dict[str, ClockWarp | None] = {}
    for flight, item in zip(audited, items, strict=True):
        body = result.values.get(item.key)
        warps[flight.name] = ClockWarp.from_json(body) if body else None
    return OnClock([apply_warp(f, warps[f.name]) for f in audited],
                   {f.name: audits[f.name].retimed(warps[f.name]) for f in audited}, warps, result.failed)

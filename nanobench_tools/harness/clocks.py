"""Many flights on another clock, through the runner: found once per content, then from the store."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from ..auditing.recording_audit import Audit
from ..flight import Flight
from ..signals.context import Context
from ..time_offsets.moving.apply import apply_time_offset, time_offset_of
from ..time_offsets.moving.time_offset import TimeOffset
from ..time_offsets.moving.votes import AS_RECORDED, evidence_of, voters
from .items import make_item
from .progress import Progress
from .runner import RunResult, run_items


@dataclass(frozen=True)
class OnClock:
    """flights and audits as seen with the clock; ``warps``: name of the flight -> what was taken out, None where
    nothing could be identified (such flights are as recorded); ``failed``: [{item, file, error}]."""

    flights: list[Flight]
    audits: dict[str, Audit]
    time_offsets: dict[str, TimeOffset | None]
    failed: list[dict[str, str]]

    @property
    def evidence(self) -> list[str]:
        """The kinds of streams used to estimate any of the warps."""
        return evidence_of(self.flights)

    def evidence_for(self, names: Iterable[str]) -> list[str]:
        """The same for the flights of these ``names`` alone, such as those of one row."""
        wanted = set(names)
        return evidence_of(flight for flight in self.flights if flight.name in wanted)

    def moving(self, names: Iterable[str]) -> int:
        """How many of the flights had a moving error taken out."""
        return sum(time_offset.moving for name in names if (time_offset := self.time_offsets.get(name)) is not None)


Choice = tuple[str, tuple[str, ...]]
"""A clock, and the logged estimates that are judged on it, in order of name."""
TimeOffsets = Mapping[tuple[str, Choice], TimeOffset | None]
"""By name of the flight and clock; None where nothing could be identified."""


def time_offset_item(flight: Flight, clock: str, judged: tuple[str, ...]) -> dict[str, TimeOffset | None]:
    """{"time_offset": what to take out}."""
    return {"time_offset": time_offset_of(Context(flight), clock, judged)}


def on_clock(flights: Sequence[Flight], audits: Mapping[str, Audit], clock: str, judged: Sequence[str] = (),
             store_dir: Path | None = None, jobs: int = 1, scheduler: str | None = None,
             progress: Progress | None = None, known: TimeOffsets = MappingProxyType({})) -> OnClock:
    """``flights`` (those with an audit) and their audits on ``clock`` (``moving.votes.CLOCKS``). The ``judged`` logged
    estimates are judged on it. ``known``: time offsets found earlier, with the audit."""
    voices = tuple(sorted(judged))
    voters(clock, voices)  # report an impossible choice before anything is computed
    audited = [f for f in flights if f.name in audits]
    if clock == AS_RECORDED:
        return OnClock(audited, dict(audits), {f.name: None for f in audited}, [])
    items = [make_item(time_offset_item, {"flight": f, "clock": clock, "judged": voices},
                       f"{clock} {f.name}") for f in audited if (f.name, (clock, voices)) not in known]
    result = run_items(items, store_dir, jobs, scheduler, progress, clock) if items else RunResult({}, [])
    found = {item.kwargs["flight"].name: result.values.get(item.key, {}).get("time_offset") for item in items}
    time_offsets = {f.name: found[f.name] if f.name in found else known[f.name, (clock, voices)] for f in audited}
    return OnClock([apply_time_offset(f, time_offsets[f.name]) for f in audited],
                   {f.name: audits[f.name].retimed(time_offsets[f.name]) for f in audited}, time_offsets, result.failed)

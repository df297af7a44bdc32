"""Groups of flights of a vehicle as a diagnosis sees them, with the nominal simulator of the vehicle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from identification.mismatch.recordings import LEAST_S, Recordings, look_over
from nanobench_tools.auditing.recording_audit import Audit, audit
from nanobench_tools.auditing.selection import distinct
from nanobench_tools.flight import Flight
from nanobench_tools.harness.clocks import on_clock
from nanobench_tools.physics import Model
from nanobench_tools.sources.discover import load_recordings
from nanobench_tools.time_offsets.moving.apply import apply_time_offset
from nanobench_tools.time_offsets.moving.time_offset import TimeOffset
from nanobench_tools.version import __version__

from .kept_results import READING, code_hash, hashes, kept, key_of
from .nominal import as_json, fit_nominal, from_values
from .vehicles import VehicleSource, paths_of, with_pose

TRACKS = tuple(f"identification/mismatch/{name}.py" for name in (
    "recordings", "track", "taking_part", "tracked_point", "commanded", "measured_speed"))
"""Code that makes what a diagnosis sees of a recording."""
RECIPE = ("identification/prove/corrupted/nominal.py",)
"""Code that determines a cached nominal simulator, in addition to the version: a better fit of a later day is no other
truth."""


@dataclass(frozen=True)
class Group:
    """recordings: flights of one diagnosis; nominal: fitted to flights of no group; key: of both."""

    vehicle: str
    number: int
    recordings: Recordings
    nominal: Model
    key: str

    @property
    def name(self) -> str:
        return f"{self.vehicle}/{self.number}"


def groups_of(source: VehicleSource, root: Path, most: int | None = None,
              say: Callable[[str], None] = lambda text: None) -> list[Group]:
    """The groups of a vehicle, at most ``most``; none where its recordings are absent or too few."""
    paths = paths_of(source, root)
    chosen = dealt(paths, source.groups + 1, [source.train, *([source.of_a_group] * source.groups)])
    if not chosen or len(chosen[0]) < source.train:
        return []
    train = chosen[0]
    groups = [without_copies(group, train) for group in chosen[1:][:most]]
    read = _read([*train, *(p for g in groups for p in g)], source)
    say(f"{source.name}: nominal simulator from {len(train)} flights")
    mark = key_of("nominal", source, hashes(train), __version__, code_hash(RECIPE))
    nominal = from_values(kept(mark, dict[str, Any], lambda: as_json(fit_nominal(
        source, [f for p in train for f in read[p]], looked_over([f for p in train for f in read[p]], source)))))
    found = []
    for number, group in enumerate(groups):
        say(f"{source.name}: group {number}, {len(group)} flights")
        recordings = looked_over([f for p in group for f in read[p]], source)
        if recordings.judged_s >= LEAST_S:
            found.append(Group(source.name, number, recordings, nominal,
                               key_of(as_json(nominal), hashes(group), code_hash((*READING, *TRACKS)))))
    return found


def dealt(paths: Sequence[Path], hands: int, sizes: Sequence[int]) -> list[list[Path]]:
    """Files dealt in turn, so that each hand has flights of every kind: sorted neighbours are repetitions."""
    return [list(paths[k::hands][:size]) for k, size in zip(range(hands), sizes, strict=True) if paths[k::hands]]


def without_copies(group: Sequence[Path], train: Sequence[Path]) -> list[Path]:
    """Files of a group whose content is in no training file."""
    known = set(hashes(train))
    return [path for path, content in zip(group, hashes(group), strict=True) if content not in known]


def looked_over(flights: Sequence[Flight], source: VehicleSource) -> Recordings:
    """Audited and on the motion capture's clock; audits and clocks are kept."""
    flights = distinct(list(flights))[0]
    code = code_hash(READING)
    audits: dict[str, Audit] = {}
    offsets: dict[str, TimeOffset | None] = {}
    for flight in flights:
        mark = [flight.provenance.sha256, source.estimated_pose, code]
        audits[flight.name] = kept(key_of("audit", *mark), Audit, partial(audit, flight))
        offsets[flight.name] = kept(key_of("clock", *mark), TimeOffset | None,
                                    partial(_clock, flight, audits[flight.name]))
    moved = [apply_time_offset(f, offsets[f.name]) for f in flights]
    seen = {name: found.retimed(offsets[name]) for name, found in audits.items()}
    return look_over(flights, audits, moved, seen, source.vehicle.input == "pwm", source.vehicle)


def _clock(flight: Flight, seen: Audit) -> TimeOffset | None:
    return on_clock([flight], {flight.name: seen}, "joint").time_offsets[flight.name]


def _read(paths: Sequence[Path], source: VehicleSource) -> dict[Path, list[Flight]]:
    """Flights by file."""
    flights = load_recordings(paths).flights
    if source.estimated_pose:
        flights = [with_pose(f) for f in flights]
    return {path: [f for f in flights if Path(f.provenance.path) == path] for path in paths}

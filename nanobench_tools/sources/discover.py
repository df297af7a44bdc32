"""Finds the recordings in files and folders by their content, and reads them, cached by content hash.

``load_recordings`` is the short way; ``find_recordings`` and ``read`` are its two halves, for workers that read one
recording each.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import joblib

from ..errors import InputError, NanobenchError
from ..flight import Flight
from ..lookup.registry import load_all
from . import cache as store
from .bag_messages import span_of
from .base import SeveralVehicles, SheetSource, Source, text_fault
from .clock_jumps import on_one_clock
from .companions import PICTURES, companion
from .joined_tables import table_source
from .lost_poses import without_placeholders
from .members import FolderSource, digest_of, members_of
from .payload import HEAD_BYTES, PACKED_SUFFIXES, digest, head, read_file, unpack
from .rosbag import RosBag
from .sheets import Sheet, choose_sheet, lies_beside, looks_like_sheet, may_hold, parse_sheet, why_bad
from .split_bags import METADATA, Parts, parts_of
from .strangers import STRANGE, why_strange

BLANK = b"\x00 \r\n\t"
PICTURE = "a picture or a point cloud"
Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class Recording:
    """A file that a source recognised. ``name`` labels it and is unique in its set; ``sheets`` are those that may
    belong to it by time."""

    path: Path
    source: str
    name: str
    sheets: tuple[Sheet, ...] = ()
    columns: Path | None = None
    vehicle: str = ""
    """The one of several vehicles in the file."""
    further: tuple[Path, ...] = ()
    """Files after ``path`` of a bag that was split."""
    lost: tuple[str, ...] = ()
    """Names of files of that bag that are not there."""
    members: tuple[tuple[str, Path], ...] = ()
    """Files of a recording that is a folder, by their names in it."""


@dataclass(frozen=True)
class Loaded:
    """Flights in the order of their paths; ``failed`` names every file that is no recording, with one line why."""

    flights: list[Flight]
    failed: list[dict[str, str]]


def default_data() -> list[Path] | None:
    """Where recordings are looked for: $NANOBENCH_DATA, ./data, ../shared/data/nanobench; None without any."""
    if place := os.environ.get("NANOBENCH_DATA"):
        return [Path(p) for p in place.split(os.pathsep) if p]
    for folder in (Path("data"), Path("..") / "shared" / "data" / "nanobench"):
        if folder.is_dir():
            return [folder]
    return None


def sources(columns: Path | None = None) -> dict[str, Source]:
    """Registered sources by name; with a column map the user's own table comes first."""
    found = {name: (kind() if isinstance(kind, type) else kind) for name, kind in load_all("sources").items()}
    if columns is None:
        return found
    if "rosbag" in found:
        found["rosbag"] = RosBag(columns)
    return {"table": table_source(columns), **found}


def files_in(paths: Iterable[Path], failed: list[dict[str, str]]) -> Iterator[Path]:
    """Every file below ``paths``, sorted, each once. Raises InputError for a path that is not there.

    Entries whose name starts with a dot are left out, unless given themselves.
    """
    seen: set[str] = set()

    def refuse(error: OSError) -> None:
        failed.append({
                          "path": str(error.filename),
                          "error": f"{error.filename}: cannot be listed ({error.strerror}); check its permissions",
                      })

    for place in paths:
        if not place.exists():
            raise InputError(str(place), "there is no such file or folder", "check the path")
        if place.is_dir():
            found = [Path(folder) / name for folder, folders,
                     names in _walk(place, refuse) for name in names if not name.startswith(".")]
        else:
            found = [place]
        for path in sorted(found, key=lambda p: p.parts):
            real = os.path.realpath(path)
            if real not in seen:
                seen.add(real)
                yield path


def _walk(place: Path, refuse: Callable[[OSError], None]) -> Iterator[tuple[str, list[str], list[str]]]:
    for folder, folders, names in os.walk(place, onerror=refuse):
        folders[:] = sorted(f for f in folders if not f.startswith("."))
        yield folder, folders, names


def find_recordings(paths: Sequence[Path | str],
                    columns: Path | None = None) -> tuple[list[Recording], list[dict[str, str]]]:
    """Which files below ``paths`` are recordings, of what source, with which sheets. Sorted by path.

    Raises InputError for a place that does not exist or holds nothing at all. A file that nobody recognises and that
    is no known companion (sheet, licence, configuration, ...) is listed in ``failed``.
    """
    failed: list[dict[str, str]] = []
    places = [Path(p) for p in paths]
    known = sources(columns)
    found: list[tuple[Path, str, bytes]] = []
    sheets: list[Sheet] = []
    beside: set[str] = set()
    for path in files_in(places, failed):
        try:
            if not path.is_file():  # a pipe would be waited for, a broken link names nothing
                raise InputError(str(path), "not a regular file", "remove it or check where it points")
            start = head(path)
            if looks_like_sheet(start):
                sheets.append(parse_sheet(str(path), unpack(read_file(path), str(path)).data))
                continue
            name = next((n for n, s in known.items() if s.recognises(path, start)), None)
            if name is not None:
                found.append((path, name, start))
            elif start.startswith(PICTURES):
                failed.append({"path": str(path), "error": f"{path}: {STRANGE}; {PICTURE}"})
            elif (why := _stranger(path, known, beside)) is not None:
                failed.append({"path": str(path), "error": f"{path}: {why}"})
        except NanobenchError as error:
            failed.append({"path": str(path), "error": str(error)})
    _name_bad_sheets(failed, [path for path, _, _ in found])
    sheets += _sheets_beside(places, {path for path, _, _ in found}, sheets)
    if not found and not failed:
        only = f", only what lies next to recordings ({', '.join(sorted(beside))})" if beside else ""
        raise InputError(", ".join(map(str, places)) or "no path", f"no recording in it{only}",
                         "give a folder with recordings")
    bags = parts_of([path for path, name, _ in found if isinstance(known[name], RosBag)], _span_of)
    behind = {path for parts in bags.values() for path in parts.paths[1:]}
    found = [entry for entry in found if entry[0] not in behind]
    found, labelled, members = _gathered(found, known)
    folders = {p.parent.parent for files in members.values() for name, p in files if "/" in name}
    inside = {str(p) for files in members.values() for _, p in files}
    failed[:] = [f for f in failed if f["path"] not in inside and not (
        _is_picture(f) and any(Path(f["path"]).is_relative_to(p) for p in folders))]
    names = _labels([labelled.get(path, path) for path, _, _ in found])
    recordings = []
    for (path, source, start), label in zip(found, names, strict=True):
        if path in members:
            recordings.append(Recording(path, source, label, columns=columns, members=members[path]))
            continue
        parts = bags.get(path, Parts((path,)))
        recordings += [Recording(path, source, f"{label}.{vehicle}" if vehicle else label,
                                 _candidates(known[source], sheets, path, start), columns, vehicle, parts.paths[1:],
                                 parts.lost)
                       for vehicle in _vehicles(known[source], parts.paths)]
    return recordings, failed


def _is_picture(failure: Mapping[str, str]) -> bool:
    return failure["error"].endswith(PICTURE)


Found = list[tuple[Path, str, bytes]]


def _gathered(found: Found, known: Mapping[str, Source]) -> tuple[
        Found, dict[Path, Path], dict[Path, tuple[tuple[str, Path], ...]]]:
    """Recordings in place of the files of which they consist, in the order of their first files. By their paths: what
    to call them, and their files."""
    order = {path: place for place, (path, _, _) in enumerate(found)}
    kept = [entry for entry in found if not isinstance(known[entry[1]], FolderSource)]
    labels, members = {}, {}
    for name in dict.fromkeys(name for _, name, _ in found):
        source = known[name]
        if isinstance(source, FolderSource):
            for group in source.gather([path for path, other, _ in found if other == name]):
                kept.append((group.place, name, b""))
                labels[group.place] = group.label
                members[group.place] = tuple(group.files.items())
    inside = {path for files in members.values() for _, path in files}
    kept = [entry for entry in kept if entry[0] in members or entry[0] not in inside]

    def place(entry: tuple[Path, str, bytes]) -> int:
        path = entry[0]
        return min(order.get(p, len(order)) for p in (path, *dict(members.get(path, ())).values()))

    return sorted(kept, key=place), labels, members


def _vehicles(source: Source, paths: Sequence[Path]) -> tuple[str, ...]:
    """Labels of the vehicles in a recording; one empty label where there is one, or the files cannot be read."""
    if not isinstance(source, SeveralVehicles):
        return ("",)
    try:
        return source.vehicles(paths[0], [unpack(read_file(path), str(path)).data for path in paths])
    except NanobenchError:
        return ("",)  # said again when it is read


def _span_of(path: Path) -> tuple[float, float] | None:
    try:
        return span_of(unpack(read_file(path), str(path)).data, str(path))
    except NanobenchError:
        return None  # said again when it is read


def _name_bad_sheets(failed: list[dict[str, str]], recordings: Sequence[Path]) -> None:
    """An unrecognised YAML file in the place of a recording's sheet is reported as a bad sheet."""
    for entry in failed:
        path = Path(entry["path"])
        strange = entry["error"].startswith(f"{path}: {STRANGE}")
        if strange and path.suffix.lower() in (".yaml", ".yml") and any(lies_beside(path, r) for r in recordings):
            entry["error"] = why_bad(path)


def _sheets_beside(places: Sequence[Path], files: set[Path], known: Sequence[Sheet]) -> list[Sheet]:
    """Sheets in the folders of files that were given one by one; their content belongs to the recording as well."""
    folders = {path.parent for path in places if path in files}
    seen = {sheet.path for sheet in known}
    found = []
    for folder in sorted(folders):
        for path in sorted(folder.glob("*.y*ml")):
            try:
                if str(path) not in seen and path.is_file() and looks_like_sheet(head(path)):
                    found.append(parse_sheet(str(path), unpack(read_file(path), str(path)).data))
            except NanobenchError:
                continue  # the user did not give this file; the recording is read without it
    return found


def _candidates(source: Source, sheets: Sequence[Sheet], path: Path, start: bytes) -> tuple[Sheet, ...]:
    """Sheets whose time fits the first row (all that could when it cannot be read)."""
    if not sheets or not isinstance(source, SheetSource):
        return ()
    first_s = source.start_unix_s(start)
    return tuple(s for s in sheets if may_hold(s, path, first_s))


def _stranger(path: Path, known: Mapping[str, Source], companions: set[str]) -> str | None:
    """Why a file is no recording, or None for a known companion, whose kind is added to ``companions``."""
    stored = read_file(path)
    if not stored:
        return "the file is empty"
    data = unpack(stored, str(path)).data
    kind = companion(data)
    if kind is not None:
        companions.add(kind)
    return None if kind is not None else why_strange(data, known.values())


def _labels(paths: Sequence[Path]) -> list[str]:
    """File names without suffixes; where two are the same, folders are put in front until they differ."""
    parts = [(*p.parent.parts, _stem(p.name)) for p in map(Path.absolute, paths)]
    depth = [1] * len(parts)
    while True:
        labels = [".".join(p.strip("/") for p in q[-d:] if p != "/") for q, d in zip(parts, depth, strict=True)]
        count = Counter(labels)
        again = [i for i, label in enumerate(labels) if count[label] > 1 and depth[i] < len(parts[i])]
        if not again:
            break
        for i in again:
            depth[i] += 1
    twice = Counter(labels)
    for i, label in enumerate(labels):  # same folder and stem, other suffix
        if twice[label] > 1:
            labels[i] = f"{label}{''.join(paths[i].suffixes)}"
    return labels


def _stem(name: str) -> str:
    for suffix in PACKED_SUFFIXES:
        name = name.removesuffix(suffix)
    stem, dot, suffix = name.rpartition(".")
    return stem if dot and stem and suffix.isalnum() and not suffix.isdigit() and len(suffix) <= 8 else name


def read(recording: Recording, cache: bool = True) -> Flight:
    """The flight of a recording. Raises InputError that names the file."""
    path = recording.path
    source = sources(recording.columns)[recording.source]
    if recording.members and isinstance(source, FolderSource):
        return _read_members(recording, source, cache)
    if recording.vehicle and isinstance(source, SeveralVehicles):
        source = source.of(recording.vehicle)
    stored = [read_file(part) for part in (path, *recording.further)]
    sha256 = digest(stored[0]) if len(stored) == 1 else digest("".join(map(digest, stored)).encode())
    entry = store.entry_path(sha256, source.name, source.version)
    flight = store.fetch(entry, str(path), sha256) if cache else None
    if flight is None:
        payloads = [unpack(data, str(part)) for data, part in zip(stored, (path, *recording.further), strict=True)]
        data, broken = payloads[0].data, "; ".join(filter(None, (p.broken for p in payloads)))
        if not data[:HEAD_BYTES].strip(BLANK) and not data.strip(BLANK):
            raise InputError(str(path), "the file is empty", broken or "take another copy")
        made = (source.read_parts(path, [p.data for p in payloads]) if isinstance(source, RosBag)
                else source.read(path, data))
        flight = without_placeholders(_with_break(on_one_clock(made), broken))
        if cache:
            store.store(entry, flight)
    if recording.lost:
        flight = _with_break(flight, f"{METADATA} lists {', '.join(recording.lost)}, which is not there")
    provenance = replace(flight.provenance, path=str(path), sha256=sha256, source=source.name)
    flight = replace(flight, name=recording.name, provenance=provenance)
    if recording.sheets and flight.streams:
        time_s = max(flight.streams.values(), key=len).time_s
        sheet, own = choose_sheet(recording.sheets, path, flight.epoch_s + time_s, flight.metadata.get("rows_in_file"))
        if sheet is not None and isinstance(source, SheetSource):
            flight = source.with_sheet(flight, sheet, own)
    return flight


def _read_members(recording: Recording, source: FolderSource, cache: bool) -> Flight:
    path = recording.path
    members, broken = members_of(dict(recording.members), source.wanted)
    sha256 = digest_of(members)
    entry = store.entry_path(sha256, source.name, source.version)
    flight = store.fetch(entry, str(path), sha256) if cache else None
    if flight is None:
        flight = without_placeholders(_with_break(on_one_clock(source.read_members(path, members)), broken))
        if cache:
            store.store(entry, flight)
    return replace(flight, name=recording.name, provenance=replace(flight.provenance, path=str(path), sha256=sha256,
                                                                   source=source.name))


def _with_break(flight: Flight, broken: str) -> Flight:
    """Notes an archive that ended early; a last line that was cut by the same break is part of the same fault."""
    if not broken:
        return flight
    end = flight.span.end_s
    others = tuple(f for f in flight.provenance.findings if f.kind != "truncated")
    cut = [f.evidence for f in flight.provenance.findings if f.kind == "truncated"]
    fault = text_fault("truncated", "", (), "; ".join([broken, *cut]), (end, end))
    return replace(flight, provenance=replace(flight.provenance, findings=(*others, fault)))


def _attempt(recording: Recording, cache: bool) -> Flight | dict[str, str]:
    try:
        return read(recording, cache)
    except NanobenchError as error:
        return {"path": str(recording.path), "error": str(error)}
    except Exception as error:  # a source may come from outside; one file must not take the others with it
        return {
            "path": str(recording.path),
            "error": f"{recording.path}: source {recording.source} failed, {type(error).__name__}: {error}",
        }


def load_recordings(paths: Sequence[Path | str], columns: Path | None = None, cache: bool = True,
                    progress: Progress | None = None, jobs: int = 1) -> Loaded:
    """Read every recording below ``paths``; the result does not depend on ``jobs`` or on the file system.

    ``columns`` is a column map for the user's own tables. ``progress(done, all, path)`` is called after each file.
    Raises InputError for a place that does not exist or is empty, and for a bad column map. A file that cannot be read
    is listed in ``failed``.
    """
    recordings, failed = find_recordings(paths, columns)
    results = joblib.Parallel(n_jobs=jobs, backend="threading", return_as="generator")(
        joblib.delayed(_attempt)(recording, cache) for recording in recordings
    )
    flights: list[Flight] = []
    for done, (recording, result) in enumerate(zip(recordings, results, strict=True), start=1):
        if isinstance(result, Flight):
            flights.append(result)
        else:
            failed.append(result)
        if progress is not None:
            progress(done, len(recordings), str(recording.path))
    return Loaded(flights, sorted(failed, key=lambda f: f["path"]))

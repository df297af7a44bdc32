"""NanoBench CSV with its ``_metadata.yaml`` (plain, gzip or xz).

Every stream has the timestamps of the motion capture: the firmware's packets were interpolated onto them. How many
packets there really were comes from ``row_counts`` of the sheet, else from the chord test.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..flight import Fault, Flight, Provenance, Stream
from ..settings import number
from .base import cell_faults, text_fault
from .cells import Grid, LostRow, parse_number, read_grid
from .describe import describe
from .dialect import normalise_text, split_line
from .header import header_of
from .interpolation import Packets, count_packets
from .names import listed
from .nanobench_columns import COLUMN_NAMES, MARKS, PLAIN_POSE, POSITION, ROW_COUNT_KEYS, STREAMS, scales_of, units_of
from .nanobench_writer import write_nanobench
from .sheets import Sheet, normalised
from .timestamps import not_seconds

__all__ = ["NanoBench", "with_sheet", "write_nanobench"]

KNOWN = frozenset(COLUMN_NAMES)
FRAMES = {"imu": "body", "motor": "motor", "battery": "-"}  # all others: world
ENDS_EARLY_S = number("sources.nanobench.ends_early_s")
"""A recording that stops by more before the end its sheet names was cut; whole ones stop at most 0.02 s before."""
FEWEST_NAMES = 4
"""So many of the format's column names in the first line, one of ``MARKS`` among them, make a file a NanoBench CSV."""


class NanoBench:
    """Source ``nanobench``."""

    name = "nanobench"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        known = KNOWN.intersection(header_of(head)[0])
        return len(known) >= FEWEST_NAMES and not MARKS.isdisjoint(known)

    def why_not(self, head: bytes) -> str | None:
        names = header_of(head)[0]
        shared = [n for n in names if n in KNOWN]
        if len(shared) < FEWEST_NAMES or not MARKS.isdisjoint(shared):
            return None
        return f"{listed(shared)} may be a NanoBench CSV's, but has no column name that only that format has"

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        grid = read_grid(data, str(path), numeric=KNOWN)
        _check_pose(grid, str(path))
        time_unix, kept = _time(grid, str(path))
        time_s = time_unix - time_unix[0]
        streams, faults = _streams(grid, time_s, kept)
        span = (0.0, float(time_s[-1]))
        faults += cell_faults(grid, time_s, kept, {c.name: s for s, cs in STREAMS.items() for c in cs})
        if grid.truncated:
            faults.append(text_fault("truncated", "", (), grid.truncated, (span[1], span[1]), 1.0, "rows"))
        if not streams:
            raise InputError(str(path), "none of the 52 columns holds a number", "is this a NanoBench recording?")
        flight = Flight(path.name, streams, {"rows_in_file": grid.rows_in_file},
                        Provenance(str(path), "", self.name, findings=tuple(faults), notes=tuple(grid.notes)),
                        epoch_s=float(time_unix[0]))
        flight = replace(flight, metadata={**flight.metadata, **describe(flight)})
        return with_sheet(flight, sheet, own=True) if sheet else flight

    def start_unix_s(self, head: bytes) -> float | None:
        """Time of the first row, None when it cannot be read from the head."""
        names, dialect = header_of(head)
        lines = normalise_text(head).lstrip(b"\n").split(b"\n", 2)
        if "t" not in names or len(lines) < 2:
            return None
        cells = split_line(lines[1].decode("utf-8", errors="replace"), dialect.delimiter)
        time = parse_number(cells[names.index("t")]) if len(cells) == len(names) else float("nan")
        return time if np.isfinite(time) else None

    def with_sheet(self, flight: Flight, sheet: Sheet, own: bool) -> Flight:
        return with_sheet(flight, sheet, own)


def _check_pose(grid: Grid, place: str) -> None:
    """InputError for ``qx``, ``vx`` ... that are not marked as those of the motion capture. In other formats the
    vehicle's own estimate has the same names."""
    names = (*grid.columns, *grid.empty, *grid.text)
    doubtful = [n for n in PLAIN_POSE if n in names]
    if doubtful and not all(n in names for n in POSITION) and not any(n.endswith("_vicon") for n in names):
        raise InputError(
            place,
            f"{listed(doubtful)} may be the motion capture's or the vehicle's own: neither px, py, pz nor wx_vicon is "
            f"there; its columns: {listed(names)}",
            "say in a column map what they are (--columns MAP.toml, docs/recordings.md)",
        )


def _time(grid: Grid, place: str) -> tuple[np.ndarray, np.ndarray]:
    """Times of the rows that have one [Unix s] and their indices; a row without is added to ``grid.lost``."""
    if "t" not in grid.columns:
        found = "holds no number" if "t" in (*grid.empty, *grid.text) else "is not in the file"
        raise InputError(f"{place}: column t", found, "without times the rows cannot be placed")
    time = grid.columns["t"]
    readable = np.isfinite(time)
    kept = np.flatnonzero(readable)
    if not len(kept):
        first = next(iter(grid.bad["t"].what.values()), "") if "t" in grid.bad else ""
        found = f"holds no number{first and f', but {first}'}"
        raise InputError(f"{place}: column t", found, "without times in seconds the rows cannot be placed")
    if (why := not_seconds(time[kept])) is not None:
        raise InputError(f"{place}: column t", why, "write them in seconds, or name column and unit in a column map")
    bad = grid.bad.pop("t", None)
    for row in np.flatnonzero(~readable):
        what = bad.what.get(int(row), "no number") if bad else "no number"
        grid.lost.append(LostRow(int(grid.lines[row]), int(row) - 1, f"row {row + 1}, column t: {what}"))
    return time[kept], kept


def _streams(grid: Grid, time_s: np.ndarray, kept: np.ndarray) -> tuple[dict[str, Stream], list[Fault]]:
    streams: dict[str, Stream] = {}
    faults: list[Fault] = []
    span = (0.0, float(time_s[-1]))
    for name, columns in STREAMS.items():
        here = tuple(c for c in columns if c.name in grid.columns)
        missing = tuple(c.name for c in columns if c.name not in grid.columns)
        if missing:
            empty = [c for c in missing if c in grid.empty]
            how = "without any value" if len(empty) == len(missing) else "not in the file"
            faults.append(
                text_fault("missing_column", name, missing, f"{', '.join(missing)}: {how}", span, float(len(missing)),
                           "columns")
            )
        if not here:
            continue
        scales = scales_of(here)
        raw = np.stack([grid.columns[c.name] for c in here], axis=1)
        if len(kept) < len(raw):
            raw = raw[kept]
        resolution = np.array([10.0 ** -grid.decimals.get(c.name, 9) for c in here])
        packets = Packets(len(raw), span[1]) if name == "mocap" else count_packets(time_s, raw, resolution)
        streams[name] = Stream(time_s, raw * scales, tuple(c.name for c in here), tuple(c.quantity for c in here),
                               units_of(here), frame=FRAMES.get(name, "world"), samples=packets.count,
                               rate_hz=packets.count / packets.last_s if packets.last_s > 0.0 else float("nan"))
    extra = [c for c in grid.columns if c not in KNOWN]
    if extra:
        values = np.stack([grid.columns[c] for c in extra], axis=1)[kept]
        streams["extra"] = Stream(time_s, values, tuple(extra), tuple(extra), ("1",) * len(extra))
    for column in (*extra, *grid.text, *(c for c in grid.empty if c not in KNOWN)):
        what = (
            "kept in stream extra" if column in extra else "text, left out" if column in grid.text else "no value in it"
        )
        faults.append(
            text_fault("extra_column", "extra", (column,), f"column {column} is not of this format; {what}", span, 1.0,
                       "columns")
        )
    for column in grid.repeated:
        faults.append(
            text_fault("extra_column", next((s for s, cs in STREAMS.items() if column in [c.name for c in cs]), ""),
                       (column,), f"column {column} appears more than once; the first was read", span, 1.0,
                       "columns")
        )
    return streams, faults


def with_sheet(flight: Flight, sheet: Sheet, own: bool) -> Flight:
    """The flight with what its sheet says; ``own`` is False for a slice of the recording the sheet is about.

    The counts hold only when the file has as many rows as the sheet says: a file that was cut keeps its own estimate.
    It was cut at its end only if it stops before the end the sheet names; rows may also be missing inside, or be
    rarer.
    """
    metadata = {**flight.metadata, **normalised(sheet)}
    for key in ("family", "speed", "reference_speed_m_s"):
        if metadata[key] is None:
            metadata[key] = flight.metadata.get(key)
    provenance, streams = flight.provenance, dict(flight.streams)
    counts = sheet.counts
    rows, stated = flight.metadata.get("rows_in_file", 0), counts.get("vicon")
    if own and stated == rows:
        for name, stream in streams.items():
            count = counts.get(ROW_COUNT_KEYS.get(name, name))
            if count and name in STREAMS and stream.samples:
                streams[name] = replace(stream, samples=count, rate_hz=stream.rate_hz * count / stream.samples)
    end = flight.span.end_s
    early_s = -np.inf if sheet.end_s is None else sheet.end_s - (flight.epoch_s + end)
    if own and stated is not None and rows < stated and early_s > ENDS_EARLY_S:
        fault = text_fault(
            "truncated",
            "",
            (),
            f"the last row is {early_s:.2f} s or more before the end that the sheet states, and there are {rows} of "
            f"its {stated} rows",
            (end, end),
            float(stated - rows),
            "rows",
        )
        provenance = replace(provenance, findings=(*provenance.findings, fault))
    synthetic = sheet.content.get("synthetic")
    provenance = replace(provenance, synthetic=synthetic is True or str(synthetic).lower() == "true")
    return replace(flight, streams=streams, metadata=metadata, provenance=provenance)

"""Logs of cfclient (CSV): ``Timestamp`` in ms since boot and log variables of the Crazyflie, a file for each log block.

The files of one folder are one flight: the client makes a folder for each connection. Names, units and signs are those
of the onboard log.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..flight import Fault, Flight, Provenance
from .base import cell_faults, text_fault
from .cells import Grid, read_grid
from .header import header_of
from .known import ecosystem
from .members import Gathered
from .sheets import Sheet
from .usd import EventType, Log, streams_of

TIME = "Timestamp"
MS = 1e-3
WRAPS_MS = 1 << 24
"""The link sends the timestamps in 24 bits."""
LONGEST_MS = 1e8
_VARIABLE = re.compile(r"[A-Za-z]\w*\.[A-Za-z]\w*")


class CfClientLog:
    """Source ``cfclient``."""

    name = "cfclient"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        if not head.lstrip(b"\xef\xbb\xbf").startswith(TIME.encode()) or b"\x00" in head[:512]:
            return False
        first, *names = header_of(head)[0] or [""]
        return first == TIME and bool(names) and all(map(_VARIABLE.fullmatch, names)) and bool(
            ecosystem("crazyflie").assign(names))

    def wanted(self, names: Sequence[str]) -> list[str]:
        return []

    def gather(self, paths: Sequence[Path]) -> list[Gathered]:
        """The log blocks of a folder."""
        found = []
        for folder in dict.fromkeys(path.parent for path in paths):
            here = [path for path in paths if path.parent == folder]
            place = here[0] if len(here) == 1 else folder
            found.append(Gathered(place, place, {path.name: path for path in here}))
        return found

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        return self.read_members(path, {path.name: data})

    def read_members(self, place: Path, members: Mapping[str, bytes]) -> Flight:
        blocks = {name: _block(data, str(place) if len(members) == 1 else f"{place}/{name}")
                  for name, data in members.items()}
        start = min(int(ticks[0]) for _, ticks, _, _ in blocks.values())
        types, records = {}, {}
        faults: list[Fault] = []
        for k, (name, (variables, ticks, values, grid)) in enumerate(blocks.items()):
            fields = [(f"v{i}", "<f8") for i in range(1, len(variables) + 1)]
            dtype = np.dtype([("id", "<u2"), ("time", "<u8"), *fields])
            rows = np.zeros(len(ticks), dtype)
            rows["time"] = ticks
            for i, column in enumerate(values.T, start=1):
                rows[f"v{i}"] = column
            block = re.sub(r"\W+", "_", Path(name).stem)
            types[k], records[k] = EventType(block, variables, dtype), rows
            time_s = MS * (ticks - start)
            kept = np.flatnonzero(np.isfinite(grid.columns[TIME]))
            grid.bad.pop(TIME, None)
            faults += [f for f in cell_faults(grid, time_s, kept, {}) if not f.stream]
            if grid.truncated:
                faults.append(text_fault("truncated", "", (), grid.truncated, (float(time_s[-1]),) * 2, 1.0, "rows"))
        streams, more = streams_of(Log(0, types, records, None), records, start, MS)
        notes = [f"extra: {c} kept as found" for n, s in streams.items() if n.startswith("extra") for c in s.columns]
        return Flight(place.name, streams,
                      {"family": None, "speed": None, "reference_speed_m_s": None, "clock": "seconds since boot"},
                      Provenance(str(place), "", self.name, findings=(*faults, *more), notes=tuple(notes)),
                      epoch_s=MS * start)


def _block(data: bytes, place: str) -> tuple[tuple[str, ...], np.ndarray, np.ndarray, Grid]:
    """Names of the variables, (n,) ms since boot, (n, k) as logged, and the table."""
    grid = read_grid(data, place, numeric={TIME}, time=TIME)
    stamps = grid.columns.get(TIME, np.zeros(0))
    kept = np.isfinite(stamps)
    variables = tuple(n for n in grid.columns if n != TIME)
    if not kept.any() or not variables:
        raise InputError(place, "holds no timestamp or no variable", "take another copy of the file")
    ticks = stamps[kept]
    if not ((ticks >= 0.0) & (ticks < LONGEST_MS) & (ticks == np.round(ticks))).all():
        raise InputError(f"{place}: column {TIME}", "is no ms since boot", "cfclient writes whole milliseconds")
    whole = ticks.astype(np.int64)
    whole += np.concatenate([[0], np.cumsum(np.diff(whole) < -WRAPS_MS // 2)]) * WRAPS_MS
    return variables, whole, np.stack([grid.columns[v][kept] for v in variables], axis=1), grid

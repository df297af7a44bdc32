"""TUM trajectories: lines of ``time x y z qx qy qz qw`` [s, m], blanks between, ``#`` begins a comment."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..flight import Flight, Provenance, make_stream
from .base import cell_faults, text_fault
from .cells import Grid, LostRow, numbers, parse_number
from .dialect import normalise_text
from .sheets import Sheet

COLUMNS = ("timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw")
QUANTITIES = ("px", "py", "pz", "qx", "qy", "qz", "qw")
NORM_TOLERANCE = 0.05
"""Eight numbers in a row are a pose only when the last four have unit length to within this."""


class TumTrajectory:
    """Source ``tum``: one stream, ``mocap``. Times keep their zero in ``Flight.epoch_s``."""

    name = "tum"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        lines = [
            line.split()
            for line in normalise_text(head).split(b"\n")[:-1][:50]
            if line.strip() and not line.lstrip().startswith(b"#")
        ] or [
            line.split()
            for line in normalise_text(head).split(b"\n")
            if line.strip() and not line.lstrip().startswith(b"#")
        ]
        poses = [[parse_number(c.decode("latin-1")) for c in line] for line in lines if len(line) == 8]
        right = sum(abs(np.linalg.norm(p[4:]) - 1.0) < NORM_TOLERANCE for p in poses)
        return bool(right > 0 and 2 * right >= len(lines))

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        grid = _grid(data)
        readable = np.isfinite(grid.columns["timestamp"])
        kept = np.flatnonzero(readable)
        if not len(kept):
            raise InputError(str(path), "no line of eight numbers", "a TUM trajectory has time x y z qx qy qz qw")
        grid.lost += [
            LostRow(int(grid.lines[r]), int(r) - 1, "no number in column timestamp") for r in np.flatnonzero(~readable)
        ]
        absolute = grid.columns["timestamp"][kept]
        time_s = absolute - absolute[0]
        values = np.stack([grid.columns[c][kept] for c in COLUMNS[1:]], axis=1)
        faults = cell_faults(grid, time_s, kept, dict.fromkeys(COLUMNS[1:], "mocap"))
        if grid.truncated:
            faults.append(text_fault("truncated", "", (), grid.truncated, (float(time_s[-1]),) * 2, 1.0, "rows"))
        duration = float(time_s[-1])
        mocap = make_stream(
            "mocap",
            time_s,
            values,
            QUANTITIES,
            COLUMNS[1:],
            samples=len(time_s),
            rate_hz=(len(time_s) - 1) / duration if duration > 0.0 else float("nan"),
        )
        return Flight(
            path.name,
            {"mocap": mocap},
            {"family": None, "speed": None, "reference_speed_m_s": None},
            Provenance(str(path), "", self.name, findings=tuple(faults)),
            epoch_s=float(absolute[0]),
        )


def _grid(data: bytes) -> Grid:
    text = normalise_text(data).decode("utf-8", errors="replace")
    open_end = bool(text) and not text.endswith("\n")
    rows: list[list[str]] = []
    lines: list[int] = []
    lost: list[LostRow] = []
    truncated = ""
    pieces = text.split("\n")
    for number, line in enumerate(pieces, start=1):
        cells = line.split("#", 1)[0].split()
        if not cells:
            continue
        if len(cells) != 8:
            if open_end and number == len(pieces):
                truncated = f"the last line is cut off: {len(cells)} of 8 cells"
            else:
                lost.append(LostRow(number, len(rows) - 1, f"{len(cells)} cells where a pose has 8"))
            continue
        rows.append(cells)
        lines.append(number)
    grid = Grid({}, np.array(lines, dtype=int), len(rows) + len(lost), lost=lost, truncated=truncated)
    for k, name in enumerate(COLUMNS):
        grid.columns[name], bad = numbers([row[k] for row in rows])
        if bad is not None:
            grid.bad[name] = bad
    return grid

"""TUM trajectories: lines of ``time x y z qx qy qz qw`` [s, m], blanks between, ``#`` begins a comment.

A line of names above the poses is used (``tum_layout``): order, units, and other columns.
"""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..flight import Flight, Provenance, make_stream
from ..units import factor
from .base import cell_faults, text_fault
from .cells import GIGANTIC, Grid, LostRow, numbers
from .dialect import NUMBER
from .sheets import Sheet
from .timestamps import not_seconds
from .tum_layout import POSE, Layout, look, text_of

COLUMNS = ("timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw")
FEWEST_POSES = 2
"""For a file of doubtful layout, before it is reported as similar to a trajectory."""


class TumTrajectory:
    """Source ``tum``: one stream, ``mocap``. Times keep their zero in ``Flight.epoch_s``."""

    name = "tum"
    version = 3

    def recognises(self, path: Path, head: bytes) -> bool:
        seen = look(_first_lines(head))
        return seen.layout is not None and seen.poses > 0 and 2 * seen.poses >= seen.rows

    def why_not(self, head: bytes) -> str | None:
        if b"\x00" in head:
            return None
        seen = look(_first_lines(head))
        doubtful = seen.why and seen.rows >= FEWEST_POSES and seen.poses == 0
        return f"a TUM trajectory has time x y z qx qy qz qw, blanks between, but {seen.why}" if doubtful else None

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        layout = look(text_of(data).split("\n")).layout or Layout()
        grid, stamps, left = _grid(data, layout)
        absolute, time_s = _seconds(stamps, layout.time_unit, str(path))
        kept = np.flatnonzero(np.isfinite(absolute))
        grid.lost += [LostRow(int(grid.lines[r]), int(r) - 1, "no number in column timestamp")
                      for r in np.flatnonzero(~np.isfinite(absolute))]
        absolute, time_s = absolute[kept], time_s[kept]
        values = np.stack([grid.columns[c][kept] for c in COLUMNS[1:]], axis=1)
        values[:, :3] *= layout.length
        faults = cell_faults(grid, time_s, kept, dict.fromkeys(COLUMNS[1:], "mocap"))
        if grid.truncated:
            faults.append(text_fault("truncated", "", (), grid.truncated, (float(time_s[-1]),) * 2, 1.0, "rows"))
        faults += [
            text_fault("extra_column", "mocap", (name,), f"column {name} is no part of a trajectory, and was left out",
                       (0.0, float(time_s[-1])), 1.0, "columns")
            for name in left
        ]
        duration = float(time_s[-1])
        mocap = make_stream("mocap", time_s, values, POSE, COLUMNS[1:], samples=len(time_s),
                            rate_hz=(len(time_s) - 1) / duration if duration > 0.0 else float("nan"))
        return Flight(path.name, {"mocap": mocap}, {"family": None, "speed": None, "reference_speed_m_s": None},
                      Provenance(str(path), "", self.name, findings=tuple(faults)), epoch_s=float(absolute[0]))


def _first_lines(head: bytes) -> list[str]:
    """Whole lines of a head; the only one of a file without a line end."""
    lines = text_of(head).split("\n")
    return lines[:-1] if any(line.strip() for line in lines[:-1]) else lines


def _seconds(cells: list[str], unit: str, place: str) -> tuple[np.ndarray, np.ndarray]:
    """absolute (n,) s, nan without a number, and (n,) s since the first of them. They are subtracted before rounding:
    nanoseconds since 1970 have more digits than a float. InputError for times that are no seconds."""
    stated = numbers(cells, limit=np.inf)[0]
    absolute = stated * factor(unit or "s")
    if not np.isfinite(absolute).any():
        raise InputError(place, "no line of eight numbers", "a TUM trajectory has time x y z qx qy qz qw")
    if (why := not_seconds(absolute, declared=bool(unit))) is not None:
        advice = "say the unit in a first line such as: # timestamp [ns] tx ty tz qx qy qz qw"
        raise InputError(f"{place}: time column", why, advice)
    absolute = np.where(np.abs(absolute) < GIGANTIC, absolute, np.nan)
    kept = np.flatnonzero(np.isfinite(absolute))
    if not unit or unit == "s":
        return absolute, absolute - absolute[kept[0]]
    first, since = Decimal(cells[kept[0]]), np.full(len(cells), np.nan)
    since[kept] = [float(Decimal(cells[k]) - first) for k in kept]
    return absolute, since * factor(unit)


def _grid(data: bytes, layout: Layout) -> tuple[Grid, list[str], tuple[str, ...]]:
    """Numbers of the poses by column, the cells of their times, and further columns of the rows."""
    text = text_of(data)
    open_end = bool(text) and not text.endswith("\n")
    rows: list[list[str]] = []
    lines: list[int] = []
    lost: list[LostRow] = []
    truncated, widest = "", 0
    pieces = text.split("\n")
    for number, line in enumerate(pieces, start=1):
        cells = line.split("#", 1)[0].split()
        if not cells:
            continue
        if len(cells) not in layout.widths:
            if open_end and number == len(pieces):
                truncated = f"the last line is cut off: {len(cells)} of {layout.widths[0]} cells"
            else:
                lost.append(LostRow(number, len(rows) - 1, f"{len(cells)} cells where a pose has {layout.widths[0]}"))
            continue
        if not rows and not lost and not any(NUMBER.fullmatch(c) for c in cells):
            continue  # names above the poses
        widest = max(widest, len(cells))
        rows.append([cells[k] for k in layout.order])
        lines.append(number)
    grid = Grid({}, np.array(lines, dtype=int), len(rows) + len(lost), lost=lost, truncated=truncated)
    for k, name in enumerate(COLUMNS[1:], start=1):
        grid.columns[name], bad = numbers([row[k] for row in rows])
        if bad is not None:
            grid.bad[name] = bad
    return grid, [row[0] for row in rows], layout.left if widest > len(COLUMNS) else ()

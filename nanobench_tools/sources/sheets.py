"""The metadata sheet of a recording (YAML): its content, normalised, and the recording it belongs to.

A sheet belongs to a recording by time, not by name: the recording starts in the second the sheet names as its
start. A slice of a recording lies inside the interval of its sheet, and takes everything from it but the counts.
"""

from __future__ import annotations

import datetime
import functools
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..errors import InputError
from ..settings import number
from .payload import read_file, unpack

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
MARKS = ("row_counts", "trajectory_type", "trajectory_id", "recording_start_utc", "recording_end_utc", "crazyflie_id")
"""Keys that make a YAML mapping a sheet; two of them are enough."""

ADVICE = "mend the sheet; the recording is read without it"

SLACK_S = number("sources.sheets.slack_s")
"""The sheet's times are whole seconds; a recording may reach this far beyond them."""

SPEEDS = ("slow", "medium", "fast")
_MARK_LINE = re.compile(rb"^\s*(" + "|".join(MARKS).encode() + rb")\s*:", re.MULTILINE)
EARLY_S = number("sources.sheets.early_s")
"""A recording may begin so long before the whole second of its sheet."""


@dataclass(frozen=True)
class Sheet:
    """``content`` as found (frozen text is ``path``); start_s and end_s Unix seconds, whole, or None."""

    path: str
    content: Mapping[str, Any]
    start_s: float | None
    end_s: float | None

    @property
    def counts(self) -> dict[str, int]:
        """row_counts: stream name of the sheet -> packets; entries that are no counts are left out."""
        found = self.content.get("row_counts")
        if not isinstance(found, Mapping):
            return {}
        return {str(k): int(v) for k, v in found.items() if isinstance(v, int) and not isinstance(v, bool) and v >= 0}


def looks_like_sheet(head: bytes) -> bool:
    """At least two of the MARKS are at the start of a line."""
    return len(set(_MARK_LINE.findall(head))) >= 2


def parse_sheet(path: str, data: bytes) -> Sheet:
    """Parse a sheet. Raises InputError with the line of the fault."""
    try:
        content = yaml.load(data.decode("utf-8"), Loader=_LOADER)
    except UnicodeDecodeError as error:
        raise InputError(path, f"bad sheet: not UTF-8 text at byte {error.start}", ADVICE) from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        place = f"{path}: line {mark.line + 1}" if mark else path
        raise InputError(
            place,
            f"bad sheet: no YAML ({getattr(error, 'problem', None) or str(error).partition(chr(10))[0][:80]})",
            ADVICE,
        ) from None
    if not isinstance(content, Mapping):
        raise InputError(path, f"bad sheet: it should hold keys and values, this holds a {type(content).__name__}",
                         ADVICE)
    content = {str(k): v for k, v in content.items()}
    return Sheet(path, content, unix_time(content.get("recording_start_utc")),
                 unix_time(content.get("recording_end_utc")))


@functools.lru_cache(maxsize=1024)
def unix_time(text: object) -> float | None:
    """``20260305T054711Z`` (or ISO 8601) -> Unix seconds; None for anything else."""
    if isinstance(text, datetime.datetime):
        moment = text
    else:
        try:
            moment = datetime.datetime.fromisoformat(str(text))
        except ValueError:
            return None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=datetime.UTC)
    return moment.timestamp()


def utc_text(unix_s: float) -> str:
    """Unix seconds -> ``20260305T054711Z``, the second it lies in. Inverse of ``unix_time`` for whole seconds."""
    return datetime.datetime.fromtimestamp(int(unix_s // 1), datetime.UTC).strftime("%Y%m%dT%H%M%SZ")


def normalised(sheet: Sheet) -> dict[str, Any]:
    """The sheet's own keys and the ones every flight has: family, speed, reference_speed_m_s, duration_s, ..."""
    params = sheet.content.get("params")
    params = params if isinstance(params, Mapping) else {}
    words = re.split(r"[^A-Za-z0-9]+", str(sheet.content.get("trajectory_id", "")).lower())
    family = sheet.content.get("trajectory_type")
    return {
        **sheet.content,
        "family": str(family) if isinstance(family, str) and family else None,
        "speed": next((s for s in SPEEDS if s in words), None),
        "reference_speed_m_s": _number(params.get("speed_mps")),
        "duration_s": _number(params.get("duration_s")),
        "start_unix_s": sheet.start_s,
        "end_unix_s": sheet.end_s,
    }


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def may_hold(sheet: Sheet, path: Path, first_s: float | None) -> bool:
    """Whether ``sheet`` can be about a recording at ``path`` whose first row is at ``first_s`` (Unix s, None: unknown).

    A sheet without times can only belong to the CSV in its folder.
    """
    if sheet.start_s is None:
        return lies_beside(Path(sheet.path), path)
    return first_s is None or (
        sheet.start_s - SLACK_S <= first_s and (sheet.end_s is None or first_s <= sheet.end_s + SLACK_S)
    )


def choose_sheet(sheets: Iterable[Sheet], path: Path, time_unix_s: np.ndarray,
                 rows: int | None) -> tuple[Sheet | None, bool]:
    """The sheet of a recording with these times (n,) [Unix s], and whether it is its own or that of a longer recording.

    It belongs to the recording that starts in the second the sheet gives. A sheet without a start belongs to the CSV in
    its folder. The middle 90 % of the rows must lie in the interval, so that single bad timestamps do not matter. Among
    several the number of rows decides, then the later start; only then where the sheet lies.
    """
    if not len(time_unix_s):
        return None, False
    first, (low, high) = float(time_unix_s[0]), np.quantile(time_unix_s, (0.05, 0.95))
    fits: list[tuple[tuple[Any, ...], Sheet, bool]] = []
    for sheet in sheets:
        if sheet.start_s is None:
            own = True
        elif sheet.start_s - SLACK_S <= low and (sheet.end_s is None or high <= sheet.end_s + SLACK_S):
            own = -EARLY_S <= first - sheet.start_s < SLACK_S
        else:
            continue
        beside, near = lies_beside(Path(sheet.path), path), Path(sheet.path).parent == path.parent
        order = (not own, sheet.counts.get("vicon") != rows, -(sheet.start_s or 0.0), not beside, not near, sheet.path)
        fits.append((order, sheet, own))
    if not fits:
        return None, False
    _, sheet, own = min(fits, key=lambda fit: fit[0])
    return sheet, own


def lies_beside(sheet: Path, path: Path) -> bool:
    """``x_metadata.yaml`` in the folder of ``x.csv``."""
    stem = sheet.name.rpartition(".")[0].removesuffix("_metadata")
    return sheet.parent == path.parent and path.name.startswith(f"{stem}.")


def why_bad(path: Path) -> str:
    """Error of a file in the place of a sheet: one line, as of an InputError."""
    try:
        parse_sheet(str(path), unpack(read_file(path), str(path)).data)
    except InputError as error:
        return str(error)
    return f"{path}: bad sheet: it has none of the keys of one; {ADVICE}"

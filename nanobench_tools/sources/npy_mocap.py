"""Motion capture saved as a NumPy array (Bitcraze's positioning data set): ms, position [m], and four markers.

The array is (n, 4) or (n, 16). Rows of NaN are frames in which the body was not seen. There is no attitude.
``nanobench convert LOG --mocap FILE.npy`` joins it with the log of the flight by their speeds.
"""

from __future__ import annotations

import ast
import io
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..flight import Flight, Provenance, make_stream
from .payload import check_size
from .sheets import Sheet

MAGIC = b"\x93NUMPY"
WIDTHS = (4, 16)
MARKERS = 4
FASTEST_MS, SLOWEST_MS = 0.5, 100.0
"""Step between frames: 2 kHz to 10 Hz. Seconds or microseconds lie outside."""
LARGEST_M = 100.0
"""No room with motion capture is larger; millimetres exceed it."""
SAME_M = 1e-3
"""The position is the mean of the markers to within this."""


class NpyMocap:
    """Source ``npy_mocap``: one stream, ``mocap``, of positions."""

    name = "npy_mocap"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        about = _about(head)
        shape = about.get("shape")
        return (about.get("descr") in ("<f8", "<f4") and isinstance(shape, tuple) and len(shape) == 2
                and shape[1] in WIDTHS)

    def why_not(self, head: bytes) -> str | None:
        return (f"a NumPy array of the shape {_about(head).get('shape')}; motion capture has ms and x, y, z in m, and "
                "may have four markers" if head.startswith(MAGIC) else None)

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        place, shape = str(path), _about(data).get("shape", (0, 0))
        check_size(place, int(np.prod(shape)), data)
        try:
            cells = np.load(io.BytesIO(data), allow_pickle=False).astype(float)
        except (ValueError, EOFError, OSError) as error:
            told = " ".join(str(error).split())[:80]
            raise InputError(place, f"cannot be read as a NumPy array ({told})", "take another copy") from None
        seen = np.isfinite(cells[:, 0])
        if seen.sum() < 2:
            raise InputError(place, "an array without a row of numbers", "take another copy")
        position = cells[seen, 1:4]
        stamps = cells[seen, 0]
        step, reach = float(np.median(np.diff(stamps))), float(np.nanmax(np.abs(position), initial=0.0))
        if not FASTEST_MS <= step <= SLOWEST_MS:
            raise InputError(f"{place}: column 0", f"frames {step:.4g} apart are no ms of motion capture",
                             "save the time in ms, or give a table with a column map")
        if not 0.0 < reach < LARGEST_M:
            raise InputError(f"{place}: column 1", f"positions reach {reach:.4g}: not in m", "save them in m")
        if cells.shape[1] == WIDTHS[1]:
            mean = cells[seen, 4:].reshape(-1, MARKERS, 3).mean(axis=1)
            apart = np.linalg.norm(mean - position, axis=1)
            if np.isfinite(apart).any() and float(np.nanmedian(apart)) > SAME_M:
                raise InputError(f"{place}: columns 4 to 15", "their mean is not the position in columns 1 to 3: no "
                                 "markers of it", "give a table with a column map")
        there = np.isfinite(position).all(axis=1)
        position[~there] = np.nan
        time_s = 1e-3 * (stamps - stamps[0])
        duration = float(time_s[-1])
        mocap = make_stream("mocap", time_s, position, ("px", "py", "pz"), samples=int(there.sum()),
                            rate_hz=(len(time_s) - 1) / duration if duration > 0.0 else float("nan"))
        lost = int(len(cells) - seen.sum())
        notes = [f"{lost} rows without a time left out: frames in which the body was not seen"] if lost else []
        return Flight(path.name, {"mocap": mocap}, {"family": None, "speed": None, "reference_speed_m_s": None},
                      Provenance(place, "", self.name, notes=tuple(notes)), epoch_s=1e-3 * float(stamps[0]))


def _about(head: bytes) -> dict[str, Any]:
    """The header of an array; empty where it is none."""
    if not head.startswith(MAGIC) or len(head) < 12:
        return {}
    start = 10 if head[6] == 1 else 12
    size = int.from_bytes(head[8:start], "little")
    try:
        about = ast.literal_eval(head[start:start + min(size, 2000)].decode("latin-1").strip())
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return {}
    return about if isinstance(about, dict) else {}

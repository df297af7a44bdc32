"""mocap_occlusion: the tracker lost sight of the vehicle and its rows were filled.

Found where poses are not numbers, repeat the pose before exactly, or lie on a straight line between two frames
(kink test); a tracker's noise allows neither. Frames that are missing altogether are a ``gap`` of the motion capture.
Standing still to the end of the recording is ``dead_stream``.

Size: seconds between the true poses on either side. Smallest found: 0.05 s.
"""

from __future__ import annotations

import numpy as np

from ..content.context import Context
from ..content.packets import packets_of
from ..content.rows import runs, typical_step_s, usable_streams
from ..content.tails import alive_until
from ..flight import Fault, Flight

KIND = "mocap_occlusion"

SHORTEST_S = 0.05
POSITION, ROTATION = ("px", "py", "pz"), ("qx", "qy", "qz", "qw")


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per filled stretch."""
    stream = context.once(usable_streams).get("mocap")
    if stream is None or "mocap" not in context.once(packets_of):
        return []
    names = [q for q in POSITION + ROTATION if q in stream.quantities]
    if not names:
        return []
    pose = stream[names]
    t, step = stream.time_s, typical_step_s(stream.time_s)
    lost = ~np.isfinite(pose).all(axis=1)
    same = np.zeros(len(t), dtype=bool)
    same[1:] = (pose[1:] == pose[:-1]).all(axis=1)
    drawn = _straight(t, stream[[q for q in POSITION if q in stream.quantities]])
    end = context.once(alive_until)["mocap"]
    columns = tuple(stream.columns[stream.index(q)] for q in names)
    faults = []
    for what, flags in (("are no numbers", lost), ("repeat one pose", same & ~lost), ("lie on a straight line", drawn & ~same & ~lost)):
        for a, b in runs(flags):
            start, stop = float(t[max(a - 1, 0)]), float(t[min(b, len(t) - 1)])
            if stop - start < SHORTEST_S + 0.5 * step or start >= end:
                continue
            faults.append(Fault(KIND, "mocap", columns, start, stop, stop - start, "s",
                                f"{b - a} poses {what} from {start:.2f} to {stop:.2f} s", SHORTEST_S))
    return faults


def _straight(t: np.ndarray, p: np.ndarray) -> np.ndarray:
    """(n,) bool: on the chord of the neighbours within rounding, and moving; rotations may be filled along an arc."""
    flags = np.zeros(len(t), dtype=bool)
    if not p.shape[1]:
        return flags
    share = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None]
    bend = np.abs(p[1:-1] - (p[:-2] + (p[2:] - p[:-2]) * share))
    flags[1:-1] = (bend <= 2e-9 + 1e-12 * np.abs(p[1:-1])).all(axis=1) & (p[1:-1] != p[:-2]).any(axis=1)
    return flags

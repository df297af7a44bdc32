"""mocap_jump: between two frames the tracked pose jumps and stays there (markers mixed up, model slipped).

Found by the step between two frames beyond what the mean velocity of the three frames on either side explains. A
vehicle bends its path by up to 9 mm in a frame (72 real flights, hard landings included), more over lost frames. So
the limit is 12 mm + 60 m/s^2 dt^2 (18 mm for a frame of 10 ms). For the rotation it is 0.17 rad + 300 rad/s^2 dt^2
(noise of single frames reaches 0.07). Samples that jump and come back within three rows are ``spike``.

A jump changes the frame of the truth until another one undoes it. The fault is therefore the displaced stretch from
the jump to its counter-jump. If it never returns, the stretch goes to the end of the recording (or from the start to
the jump if that part is shorter). The rest is in one frame. One entry per displaced stretch.

Size: metres, or radians for a rotation alone. Smallest found: the limit plus the noise of the poses.
"""

from dataclasses import dataclass

import numpy as np

from ...flight import Fault, Flight
from ...signals.context import Context
from ...signals.held_poses import POSITION, ROTATION
from ...signals.pose_jumps import PoseJump, mocap_jumps
from ...signals.usable_rows import whole_span
from .kind import FaultKind

KIND = "mocap_jump"


@dataclass(frozen=True)
class Displaced:
    """From start_s to end_s the poses are off those of the rest; ``before``, ``after``: the jumps at its ends, None at
    an end of the recording."""

    start_s: float
    end_s: float
    before: PoseJump | None
    after: PoseJump | None

    @property
    def jump(self) -> PoseJump:
        """The one that leads into it, else the one out of it."""
        found = self.before or self.after
        if found is None:
            raise ValueError("a displaced stretch has a jump at one of its ends")
        return found


def displaced_stretches(context: Context) -> list[Displaced]:
    """The stretches between jumps whose poses are in another frame than the longest consistent part.

    A jump that a later one undoes leads back to the same frame, so stretches with the same sum of jumps belong
    together. Jumps are known to within their limits; sums closer than half of the smallest limit count as the same.
    """
    jumps = context.once(mocap_jumps)
    if not jumps:
        return []
    span = context.once(whole_span)
    starts = np.array([span.start_s, *(jump.end_s for jump in jumps)])
    ends = np.array([*(jump.start_s for jump in jumps), span.end_s])
    same = np.ones((len(starts), len(starts)), dtype=bool)
    for rotation in (False, True):
        kind = [jump for jump in jumps if jump.rotation == rotation]
        if not kind:
            continue
        steps = np.array([jump.offset if jump.rotation == rotation else (0.0, 0.0, 0.0) for jump in jumps])
        at = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        off = np.linalg.norm(at[:, None] - at[None, :], axis=2)
        same &= off < min(2.0 * max(jump.limit for jump in kind), 0.5 * min(jump.size for jump in kind))
    kept = same[int(np.argmax(same @ np.maximum(ends - starts, 0.0)))]
    return [Displaced(float(start if before is None else before.start_s), float(end if after is None else after.end_s),
                      before, after)
            for rest, start, end, before, after in zip(kept, starts, ends, [None, *jumps], [*jumps, None], strict=True)
            if not rest]


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per displaced stretch."""
    faults = []
    for stretch in displaced_stretches(context):
        jump = stretch.jump
        stream, unit = flight["mocap"], "rad" if jump.rotation else "m"
        columns = tuple(stream.columns[stream.index(q)] for q in (ROTATION if jump.rotation else POSITION))
        if stretch.before is None:
            how = f"does not return to where it was; the {stretch.end_s - stretch.start_s:.2f} s before are the shorter"
            how += " side and are in another frame"
        elif stretch.after is None:
            how = f"does not return; the {stretch.end_s - stretch.start_s:.2f} s to the end are in another frame"
        else:
            back = stretch.after
            how = f"next jumps between {back.start_s:.3f} and {back.end_s:.3f} s; the poses between are displaced"
        faults.append(
            Fault(KIND, "mocap", columns, stretch.start_s, stretch.end_s, jump.size, unit,
                  f"the tracked pose jumps by {jump.size:.3f} {unit} between the frames at {jump.start_s:.3f} and "
                  f"{jump.end_s:.3f} s and {how}",
                  jump.limit)
        )
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="the tracked pose jumps {count}, by {size}",
                  cuts=True, cuts_logs=False, cuts_trim=False,
                  injection="nanobench_tools.practice.inject.room:MOCAP_JUMP")

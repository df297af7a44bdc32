"""mocap_jump: between two frames the tracked pose jumps and stays there (markers mixed up, model slipped).

Found by the step between two frames beyond what the mean velocity of the three frames on either side explains. A
vehicle bends its path by up to 9 mm in a frame (72 real flights, hard landings included), more over lost frames; so
the limit is 12 mm + 60 m/s^2 dt^2 (18 mm for a frame of 10 ms), and 0.17 rad + 300 rad/s^2 dt^2 for the rotation (noise
of single frames reaches 0.07). Samples that jump and come back within three rows are ``spike``.

A jump changes the frame in which the truth is given until another one undoes it, so the fault is the displaced stretch:
from the jump to its counter-jump, or, when it never returns, to the end of the recording (from the start to the jump
if that part is shorter). What is left stands in one frame. One entry per displaced stretch.

Size: metres, or radians for a rotation alone. Smallest found: the limit plus the noise of the poses.
"""

from __future__ import annotations

from ..flight import Fault, Flight
from ..signals.context import Context
from ..signals.held_poses import POSITION, ROTATION
from ..signals.pose_jumps import displaced_stretches
from .kind import FaultKind

KIND = "mocap_jump"


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per displaced stretch."""
    faults = []
    for stretch in context.once(displaced_stretches):
        jump = stretch.jump
        stream, unit = flight["mocap"], "rad" if jump.rotation else "m"
        columns = tuple(stream.columns[stream.index(q)] for q in (ROTATION if jump.rotation else POSITION))
        if stretch.before is None:
            how = f"does not return to where it was; the {stretch.end_s - stretch.start_s:.2f} s before are the shorter"
            how += " side and stand in another frame"
        elif stretch.after is None:
            how = f"does not return; the {stretch.end_s - stretch.start_s:.2f} s to the end stand in another frame"
        else:
            back = stretch.after
            how = f"next jumps between {back.start_s:.3f} and {back.end_s:.3f} s; the poses between are displaced"
        faults.append(
            Fault(
                KIND,
                "mocap",
                columns,
                stretch.start_s,
                stretch.end_s,
                jump.size,
                unit,
                f"the tracked pose jumps by {jump.size:.3f} {unit} between the frames at {jump.start_s:.3f} and "
                f"{jump.end_s:.3f} s and {how}",
                jump.limit,
            )
        )
    return faults


FAULT = FaultKind(KIND, find, __doc__, cuts=True, cuts_logs=False, cuts_trim=False,
                  injection="nanobench_tools.practice.inject.room:MOCAP_JUMP")

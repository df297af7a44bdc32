"""mocap_jump: between two frames the tracked pose leaps and stays there (markers mixed up, model slipped).

Found by the step between two frames beyond what the mean velocity of the three frames on either side explains. A
vehicle bends its path by up to 9 mm in a frame (72 real flights, hard landings included), more over lost frames; so
the limit is 12 mm + 60 m/s^2 dt^2 (18 mm for a frame of 10 ms), and 0.17 rad + 300 rad/s^2 dt^2 for the rotation (noise
of single frames reaches 0.07). Samples that leap and come back within three rows are ``spike``. One entry per jump.

Size: metres, or radians for a rotation alone. Smallest found: the limit plus the noise of the poses.
"""

from __future__ import annotations

from ..content.context import Context
from ..content.filled import POSITION, ROTATION
from ..content.leaps import mocap_leaps
from ..flight import Fault, Flight

KIND = "mocap_jump"


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per jump."""
    faults = []
    for leap in context.once(mocap_leaps):
        stream, unit = flight["mocap"], "rad" if leap.rotation else "m"
        columns = tuple(stream.columns[stream.index(q)] for q in (ROTATION if leap.rotation else POSITION))
        faults.append(
            Fault(
                KIND,
                "mocap",
                columns,
                leap.start_s,
                leap.end_s,
                leap.size,
                unit,
                f"the tracked pose leaps by {leap.size:.3f} {unit} between the frames at {leap.start_s:.3f} and "
                f"{leap.end_s:.3f} s",
                leap.limit,
            )
        )
    return faults

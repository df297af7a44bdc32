"""mocap_occlusion: the tracker lost sight of the vehicle and its rows were filled.

Found where poses are not numbers, repeat the pose before exactly, or lie on a straight line between two frames (chord
test). The noise of a tracker excludes both. Frames that are missing altogether are a ``gap`` of the motion capture.
Standing still to the end of the recording is ``dead_stream``. A tracker that repeats one pose while the vehicle rests
before take-off has no noise at rest. On the ground its repeated poses are no loss.

Size: seconds between the true poses on either side. Smallest found: 0.05 s (2.5 usual steps where poses are rarer than
50 Hz), two rows.
"""

from ...flight import Fault, Flight, Span, intersect_spans
from ...settings import number
from ...signals.airborne import airborne_spans
from ...signals.context import Context
from ...signals.dropouts import alive_until
from ...signals.held_poses import POSITION, ROTATION, first_rest, held_poses
from ...signals.usable_rows import runs, typical_step_s, usable_streams, usual_step_s
from .kind import FaultKind

KIND = "mocap_occlusion"

SHORTEST_S = number("audit.mocap_occlusion.shortest_s")
USUAL_STEPS = number("audit.mocap_occlusion.usual_steps")


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per filled stretch."""
    held = context.once(held_poses)
    if held is None:
        return []
    stream = context.once(usable_streams)["mocap"]
    t, end = stream.time_s, context.once(alive_until)["mocap"]
    step, shortest = typical_step_s(t), max(SHORTEST_S, USUAL_STEPS * usual_step_s(t))
    columns = tuple(stream.columns[stream.index(q)] for q in POSITION + ROTATION if q in stream.quantities)
    how = (("are no numbers", held.lost), ("repeat one pose", held.same), ("lie on a straight line", held.drawn))
    faults = []
    air = context.once(airborne_spans) if context.once(first_rest) else None
    for what, flags in how:
        for a, b in runs(flags):
            start, stop = float(t[max(a - 1, 0)]), float(t[min(b, len(t) - 1)])
            if flags is held.same and air is not None and not intersect_spans([Span(start, stop)], air):
                continue
            if stop - start >= shortest + 0.5 * step and b - a > 1 and start < end:
                faults.append(Fault(KIND, "mocap", columns, start, stop, stop - start, "s",
                                    f"{b - a} poses {what} from {start:.2f} to {stop:.2f} s", shortest))
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="the cameras lost the vehicle {count} ({seconds})",
                  group="lost", cuts=True, cuts_logs=False, cuts_trim=False,
                  injection="nanobench_tools.practice.inject.room:MOCAP_OCCLUSION")

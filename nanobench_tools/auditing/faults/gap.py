"""gap: no sample of a stream for a while.

Found in two ways. Resampled streams: rows on a straight chord that moves (chord test) between two packets further
apart than 0.1 s. If the stream is slower than 50 Hz, the limit is 10 of its usual packet intervals (equal readings
hide packets). Streams with separate stamps: stamps that far apart. For the motion capture: frames further apart than
0.05 s (single frames are lost ordinarily, 20-40 ms). Where poses came irregularly, the limit is 2.5 times the step
that 95 % of them do not exceed. When the rows of a table are missing, they are missing for each of its streams.

A setpoint that is planned as a straight line is rightly a straight chord. Setpoints are therefore judged only under
three conditions. The chord lasts more than 0.25 s. Most rows of the half second on either side bend (as those of a
curved path streamed at 100 Hz do). The chord begins and ends with a bend of 4 times the usual one there. The reason:
in a chord of n rows n / 2 bends are missing at either end. A path that really straightens does so smoothly, at least
on one side of a corner.

Size: seconds between the samples. Smallest found: 0.1 s (0.05 s motion capture, 0.25 s setpoint, 1 s battery), plus
one row.
"""

import numpy as np

from ...flight import Fault, Flight
from ...settings import number
from ...signals.context import Context
from ...signals.dropouts import alive_until
from ...signals.packet_rows import packets_of
from ...signals.usable_rows import runs, typical_step_s, usable_streams, usual_step_s
from .kind import FaultKind

KIND = "gap"

SHORTEST_S = number("audit.gap.shortest_s")
SHORTEST_MOCAP_S = number("audit.gap.shortest_mocap_s")
SHORTEST_SETPOINT_S = number("audit.gap.shortest_setpoint_s")
PACKETS = number("audit.gap.packets")
SLOW_PACKETS = number("audit.gap.slow_packets")
SLOW_S = number("audit.gap.slow_s")
KINK = number("audit.gap.kink")
USUAL_STEPS = number("audit.gap.usual_steps")
DRAWN = number("audit.gap.drawn")


def shortest_s(name: str, interval_s: float) -> float:
    """The shortest gap reported for a stream whose packets come every ``interval_s``."""
    at_least = {"mocap": SHORTEST_MOCAP_S, "setpoint": SHORTEST_SETPOINT_S}.get(name, SHORTEST_S)
    return (
        max(at_least, SLOW_PACKETS * interval_s if interval_s > SLOW_S else PACKETS * interval_s)
        if np.isfinite(interval_s)
        else at_least
    )


def _bends_around(straight: np.ndarray, a: int, b: int) -> bool:
    """Whether most rows of the 50 before row ``a`` and of the 50 from row ``b`` on are bent."""
    before, after = straight[max(a - 50, 0) : a], straight[b : b + 50]
    return len(before) > 10 and len(after) > 10 and max(before.mean(), after.mean()) < DRAWN


def _kinked(values: np.ndarray, a: int, b: int) -> bool:
    """Whether the chord over rows a - 1 to b of ``values`` (n, k) has larger bends at its ends than its neighbours."""
    bend = np.abs(np.diff(values, 2, axis=0)).max(axis=1)  # of the row after each
    beside = np.concatenate([bend[max(a - 52, 0):max(a - 3, 0)], bend[b + 1:b + 51]])
    ends = [bend[max(row - 2, 0):row + 1] for row in (a - 1, b)]
    return len(beside) > 0 and all(len(end) and bool(end.max() > KINK * np.median(beside)) for end in ends)


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per gap and stream."""
    faults = []
    packets = context.once(packets_of)
    for name, stream in context.once(usable_streams).items():
        if len(stream) < 3 or name not in packets or name == "extra":
            continue  # unknown columns may be straight lines, such as a counter of rows
        shortest = shortest_s(name, packets[name].interval_s)
        found: set[tuple[float, float]] = set()
        t = stream.time_s
        step = typical_step_s(t)
        shortest = max(shortest, USUAL_STEPS * usual_step_s(t))
        for i in np.flatnonzero(np.diff(t) > shortest):
            found.add((float(t[i]), float(t[i + 1])))
        if name != "mocap":
            end = context.once(alive_until)[name]
            for a, b in runs(packets[name].straight & ~packets[name].still):
                if (
                    t[b] - t[a - 1] > shortest + 0.5 * step
                    and t[b] <= end + 1e-9
                    and (name != "setpoint" or (_bends_around(packets[name].straight, a, b)
                                                and _kinked(stream.values, a, b)))
                ):
                    found.add((float(t[a - 1]), float(t[b])))
        for start, stop in sorted(found):
            faults.append(
                Fault(KIND, name, stream.columns, start, stop, stop - start, "s",
                      f"no sample of {name} for {stop - start:.3f} s; usual is one in {packets[name].interval_s:.3f} s",
                      shortest)
            )
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="{streams} silent {count} ({seconds})",
                  group="lost", cuts=True, cuts_logs=False, injection="nanobench_tools.practice.inject.streams:GAP")

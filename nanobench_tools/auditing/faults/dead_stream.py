"""dead_stream: the log of a stream ended before the recording did, and the resampler went on.

Found by the last bend of the stream (``signals.dropouts``). Behind it every column is exactly linear in time, which no
sensor is, or exactly constant although the stream always moves. Commands may stand still (a held setpoint, motors at
0); they are called dead only where the streams with noise are dead too. Streams may end at different times; each is
reported with its own. The battery, one packet in 0.1 s, may have sent packets after the reported end that lay on the
line by chance. The end is never later than the true one by more than one packet.

Every dead end is reported. Published files have 0.2-0.4 s of it on the ground, because their streams were shifted by a
constant after the logs were closed. Those rows are as wrong as any and are cut. A reader who wants to know whether a
log stopped in the air compares start_s with ``airborne``.

Size: seconds from the last packet to the end. Smallest found: 0.1 s, or 5 packets of a stream slower than 50 Hz
(shorter ends are lost to the radio by chance). Times are right to one packet. Two deaths are not found:

- of a stream that held still before, such as a setpoint in hover, if no other stream died with it;
- of poses that stand still after a landing and did so before take-off (a tracker without noise at rest).
"""

from ...flight import Fault, Flight
from ...signals.airborne import airborne_spans
from ...signals.context import Context
from ...signals.dropouts import PACKETS, SHORTEST_S, dropouts_of
from ...signals.held_poses import first_rest
from ...signals.packet_rows import packets_of
from ...signals.usable_rows import usable_streams
from .kind import FaultKind

KIND = "dead_stream"


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per dead stream."""
    streams, packets, air = context.once(usable_streams), context.once(packets_of), context.once(airborne_spans)
    faults = []
    for name, dropout in context.once(dropouts_of).items():
        lasts = dropout.to_s - dropout.from_s
        how = "run along a straight line" if dropout.moving else "stand still"
        flying = any(s.start_s < dropout.from_s < s.end_s for s in air)
        if name == "mocap" and air and not flying and not dropout.moving and context.once(first_rest):
            continue
        where = "in the air" if flying else "on the ground"
        faults.append(
            Fault(KIND, name, streams[name].columns, dropout.from_s, dropout.to_s, lasts, "s",
                  f"last packet of {name} at {dropout.from_s:.2f} s ({where}); the {lasts:.2f} s to the last row {how}",
                  max(SHORTEST_S, PACKETS * packets[name].interval_s))
        )
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="the log of {streams} ended {seconds} before the recording, {where}",
                  group="lost", cuts=True, log_ended=True,
                  injection="nanobench_tools.practice.inject.streams:DEAD_STREAM")

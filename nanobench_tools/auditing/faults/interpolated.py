"""interpolated (information, no fault): how many rows of a stream carry no packet.

Found from the number of packets: the recording's sheet counts them, else they are estimated from the corners of the
piecewise straight lines. Interpolated rows must not count as independent measurements. Size: share of the rows.
Smallest reported: 1 %.
"""

from ...flight import Fault, Flight
from ...settings import number
from ...signals.context import Context
from ...signals.rates import rates_of
from .kind import FaultKind
from .making import over_stream

KIND = "interpolated"

SMALLEST = number("audit.interpolated.smallest")


def find(flight: Flight, context: Context) -> list[Fault]:
    """One entry per resampled stream."""
    faults = []
    for name, rate in context.once(rates_of).items():
        if name == "extra":
            continue  # whether its columns have packets is unknown
        stream = flight.streams[name]
        share = 1.0 - rate.samples / len(stream) if len(stream) else 0.0
        if share > SMALLEST:
            evidence = f"{rate.samples} packets in {len(stream)} rows of {name}, {rate.rate_hz:.0f} a second"
            faults.append(over_stream(KIND, flight, name, None, share, "1", evidence, SMALLEST))
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="rows of {streams} are interpolated between packets",
                  group="information", whole=True, in_overview=False, in_diagnosis=False)

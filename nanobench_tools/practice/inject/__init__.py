"""Known faults put into recordings, practice or real, so that the audit can be tested against the truth.

``INJECTIONS[kind].function(flight, rng, size, **where) -> (flight, Fault)``; ``FILE_INJECTIONS`` act on the bytes of a
CSV: ``function(data, rng, size) -> (data, Fault)``. Each kind of fault names its own (``faults.kind``), other people's
kinds too. The input is never changed. ``stream`` empty in the truth means all streams of the vehicle (or the file) at
once. ``checksum`` belongs to binary logs and has no injection here.
"""

from ...auditing.faults.kind import Blind, Injection
from ...auditing.faults.kinds import kinds

__all__ = ["FILE_INJECTIONS", "INJECTIONS", "Blind", "Injection"]


INJECTIONS: dict[str, Injection] = {
    name: injection for name, kind in kinds().items() if (injection := kind.into_flight) is not None}
"""Kind of fault -> how to put it into a Flight."""

FILE_INJECTIONS: dict[str, Injection] = {
    name: injection for name, kind in kinds().items() if (injection := kind.into_file) is not None}
"""Kind of fault -> how to put it into the bytes of a NanoBench CSV."""

"""half_precision: values of 16 bits just below 0.5, 2, 8 ... that the firmware halved when it logged them.

Found and doubled by the reader of uSD logs (``sources.halved_values``), in variables that were logged with half
precision before firmware 2026.08. Size: values. Smallest found: one value.
"""

from __future__ import annotations

from ...flight import Fault, Flight
from ...signals.context import Context
from .kind import FaultKind
from .making import findings

KIND = "half_precision"


def find(flight: Flight, context: Context) -> list[Fault]:
    """The reader's findings."""
    return findings(flight, KIND)


FAULT = FaultKind(KIND, find, __doc__,
                  told="{columns} {is} halved in {count} (half precision before firmware 2026.08), and doubled again",
                  advice="none: the values were doubled; log with firmware 2026.08 or later")

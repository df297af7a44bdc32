"""half_precision: values of 16 bits just below 0.5, 2, 8 ... that the firmware halved when it logged them.

Found and doubled by the reader of uSD logs (``sources.halved_values``), in variables that were logged with half
precision before firmware 2026.08. Size: values. Smallest found: one value.
"""

from .kind import FaultKind
from .making import found_by_reader

KIND = "half_precision"

FAULT = FaultKind(KIND, found_by_reader(KIND), __doc__,
                  told="{columns} {is} halved in {count} (half precision before firmware 2026.08), and doubled again",
                  advice="none: the values were doubled; log with firmware 2026.08 or later")

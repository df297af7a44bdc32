"""truncated: the file ends early.

Found by the reader: a last row or record that is cut off. Or fewer rows than the recording's sheet counts, with an end
more than 0.1 s before the stated one. Rows alone may be missing inside, or be rarer. Size: rows or bytes that are
missing, as far as known. Smallest found: one.
"""

from .kind import FaultKind
from .making import found_by_reader

KIND = "truncated"

FAULT = FaultKind(KIND, found_by_reader(KIND), __doc__,
                  told="the file ends early",
                  advice="copy the log again; the existing part is used",
                  group="lost", file_injection="nanobench_tools.practice.inject.files:TRUNCATED")

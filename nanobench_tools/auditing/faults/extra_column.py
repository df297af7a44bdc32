"""extra_column: a column that the format does not have, or the same one twice.

Found by the reader, which keeps its numbers in a separate stream.
Size: columns. Smallest found: one column.
"""

from .kind import FaultKind
from .making import found_by_reader

KIND = "extra_column"

FAULT = FaultKind(KIND, found_by_reader(KIND), __doc__,
                  told="columns that the format does not have: {columns}",
                  advice="name them in a column map, or leave them",
                  group="information", whole=True, in_diagnosis=False,
                  file_injection="nanobench_tools.practice.inject.files:EXTRA_COLUMN")

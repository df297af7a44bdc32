"""checksum: the content of a binary log does not fit its checksum.

Found by the reader (CRC-32 of uSD-deck logs); which bytes are wrong is not known, so the whole log is in doubt.
Size: none. Smallest found: any wrong byte but with a chance of 2e-10.
"""

from .kind import FaultKind
from .making import found_by_reader

KIND = "checksum"

FAULT = FaultKind(KIND, found_by_reader(KIND), __doc__,
                  told="the file's checksum does not fit its content",
                  advice="copy the log again from its card",
                  group="lost", cuts=True, whole=True)

"""Faults of a gyro and an attitude that contradict each other, and the recording without that contradiction.

The other checks then do not report its consequences.
"""

import math
from collections.abc import Iterator

from ..flight import Fault
from ..signals.context import Context
from ..signals.estimated_turning import GYRO
from ..signals.turning_doubt import TurningDoubt, turning_doubt
from .faults import axis_swap, sign
from .faults.making import OR, SINCE, over_stream


def settled(context: Context) -> tuple[list[Fault], Context]:
    """The faults, and the recording with the wrong columns mended.

    Where it is open which columns are wrong, all possible ones have a fault, with one evidence."""
    doubt = context.once(turning_doubt)
    if doubt is None:
        return [], context
    blamed = list(_blamed(doubt))
    text = OR.join(dict.fromkeys(words for *_, words in blamed))
    if not doubt.wrong:
        text = f"the gyro turns otherwise than the attitude: {text}" + f" ({doubt.why})" * bool(doubt.why)
    faults = [over_stream(kind, context.flight, stream, columns, -1.0 if kind == sign.KIND else math.nan, "1",
                          text if not doubt.wrong else f"{words}{SINCE}{doubt.why}")
              for kind, stream, columns, words in blamed]
    return faults, Context(doubt.mended(context.flight))


def _blamed(doubt: TurningDoubt) -> Iterator[tuple[str, str, tuple[str, ...], str]]:
    """(kind of fault, stream, columns, words) of everything that may be wrong."""
    moved = tuple(q for i, q in enumerate(GYRO) if doubt.gyro[i, i] == 0.0)
    negated = tuple(q for i, q in enumerate(GYRO) if doubt.gyro[i, i] < 0.0)
    words = [f"{' and '.join(moved)} changed places"] * bool(moved)
    words += [f"{' and '.join(negated)} {'is' if len(negated) == 1 else 'are'} negated"] * bool(negated)
    if doubt.wrong != doubt.stream:
        if moved:
            yield axis_swap.KIND, "imu", moved, " and ".join(words)
        for q in negated:
            yield sign.KIND, "imu", (q,), " and ".join(words)
    for change in doubt.changes if doubt.wrong != "imu" else ():
        if len(change) > 1:
            yield axis_swap.KIND, doubt.stream, change, f"{' and '.join(change)} of {doubt.stream} changed places"
        else:
            what = f"the quaternions of {doubt.stream} are inverted" if change == ("qw",) else (
                f"{change[0]} of {doubt.stream} is negated")
            yield sign.KIND, doubt.stream, change, what

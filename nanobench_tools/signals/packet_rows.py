"""Which rows of a stream can hold a measured value, and where the stream moves, holds or runs straight.

A resampler interpolates between packets. Rows without a packet therefore lie on the chord of their neighbours in every
column (the chord test of ``sources.interpolation``). Streams that keep their sensor's timestamps have none.
"""

from dataclasses import dataclass

import numpy as np

from ..flight import Stream
from ..settings import number
from ..sources.interpolation import RELATIVE_TOLERANCE, carries_no_packet
from .context import Context
from .usable_rows import typical_step_s, usable_streams

PRINT_RESOLUTION = 2e-9
"""Two last digits of a table with nine decimals, in the units of this package; below any sensor's own step."""
ENDED = number("audit.packet_rows.ended")
BENT = number("audit.packet_rows.bent")
APART = number("audit.packet_rows.apart")


@dataclass(frozen=True)
class Packets:
    """Properties of each row.

    - straight (n,) bool: the row is on the chord of its neighbours in all columns, moving or not.
    - still (n,) bool: all columns equal those of the row before.
    - interval_s: median time between packets."""

    straight: np.ndarray
    still: np.ndarray
    interval_s: float


def packets_of(context: Context) -> dict[str, Packets]:
    """A reading for every stream with at least three rows. Rows of a thrust stand are settled points: each is measured,
    and a series of commands may well be a straight line."""
    settled = context.flight.metadata.get("kind") == "stand"
    return {name: _settled(stream) if settled else _packets(stream)
            for name, stream in context.once(usable_streams).items() if len(stream) > 2}


def _settled(stream: Stream) -> Packets:
    return Packets(np.zeros(len(stream), bool), np.zeros(len(stream), bool), typical_step_s(stream.time_s))


def _packets(stream: Stream) -> Packets:
    values = np.where(np.isfinite(stream.values), stream.values, 0.0)
    straight, still = _straight(stream.time_s, values, values)
    bent = np.flatnonzero(~straight[1:-1]) + 1
    last = bent[-1] + 1 if len(bent) else 1
    if 10 < last < ENDED * len(values):
        # a long straight end has inflated the ranges: judge again by the ranges before it
        straight, still = _straight(stream.time_s, values, values[:last])
        bent = np.flatnonzero(~straight[1:-1]) + 1
    interval = typical_step_s(stream.time_s)
    moving_bends = bent[~still[bent]]
    if len(moving_bends) > 2:
        # a packet between two rows bends both: bends next to each other are one packet when packets are rare
        steps = np.diff(stream.time_s[moving_bends])
        apart = steps[steps > 1.5 * interval]
        if 2 * len(apart) > APART * len(steps) and len(bent) < BENT * len(values):
            interval = float(np.median(apart))
    return Packets(straight, still, interval)


def _straight(time_s: np.ndarray, values: np.ndarray, judged_by: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    low, high = np.quantile(judged_by, (0.02, 0.98), axis=0) if len(judged_by) else (values[0], values[0])
    resolution = np.maximum(RELATIVE_TOLERANCE * (high - low) / 2.5, PRINT_RESOLUTION)  # the test allows 2.5 of them
    still = np.zeros(len(values), dtype=bool)
    still[1:] = (values[1:] == values[:-1]).all(axis=1)
    straight = carries_no_packet(time_s, values, resolution)
    straight[:-1] |= still[:-1] & still[1:]
    return straight, still

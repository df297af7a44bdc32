"""Rows of a log sent by radio that no packet carried, and the gaps of the radio that they show.

A resampler draws rows on a straight line where no packet came. While no packet comes down from the vehicle, none goes
up to it. Every packet of its log is the answer to one that it was sent.
"""

import numpy as np

from ..flight import Flight, Span
from ..settings import number, setting
from ..sources.interpolation import carries_no_packet

RESOLUTION = setting("audit.radio_gaps.resolution")
LONGER = number("audit.radio_gaps.longer")


def drawn(flight: Flight) -> np.ndarray:
    """(n,) at the rows of the IMU: the part of ``imu`` and ``motor`` without a packet there (0, 1/2 or 1). It is known
    one row later."""
    imu = flight["imu"]
    found = []
    for name, digits in RESOLUTION.items():
        if name not in flight:
            continue
        stream = flight[name]
        if not np.array_equal(stream.time_s, imu.time_s):
            continue
        known = {i: digit for i, quantity in enumerate(stream.quantities) for start, digit in digits.items()
                 if quantity.startswith(start)}
        found.append(carries_no_packet(stream.time_s, stream.values[:, list(known)], np.array(list(known.values()))))
    return np.mean(found, axis=0) if found else np.zeros(len(imu))


def radio_gaps(flight: Flight) -> list[Span]:
    """Spans between two packets that are further apart than packets are, on the timestamps of the IMU.

    Meant for timestamps as recorded, which are the receiver's: of a flight that was re-timed they are not. A row counts
    as drawn where both streams say so. Empty for a log whose rows are packets, or without an IMU.
    """
    if "imu" not in flight or len(flight["imu"]) < 3:
        return []
    time_s = flight["imu"].time_s
    packets = time_s[drawn(flight) < 1.0]
    apart = np.diff(packets)
    wide = np.flatnonzero(apart > LONGER * np.median(apart))
    return [Span(float(packets[i]), float(packets[i + 1])) for i in wide]

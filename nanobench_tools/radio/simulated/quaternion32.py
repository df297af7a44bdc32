"""A unit quaternion in 32 bits (quatcompress.h): which component is largest, and 10 bits for each of the others."""

import math
from collections.abc import Sequence

_FULL = 511.0 * math.sqrt(2.0)


def compress(quaternion: Sequence[float]) -> int:
    """x, y, z, w of length one -> 32 bits; the first of equally large components is the one left out."""
    values = [float(v) for v in quaternion]
    largest = max(range(4), key=lambda i: abs(values[i]))
    found = largest
    for i, value in enumerate(values):
        if i != largest:
            negative = (value < 0.0) != (values[largest] < 0.0)
            found = found << 10 | int(negative) << 9 | min(511, int(_FULL * abs(value) + 0.5))
    return found


def decompress(bits: int) -> tuple[float, float, float, float]:
    """32 bits -> x, y, z, w; the largest is positive."""
    largest = bits >> 30 & 3
    values, total = [0.0] * 4, 0.0
    for i in range(3, -1, -1):
        if i != largest:
            values[i] = (bits & 511) / _FULL * (-1.0 if bits & 512 else 1.0)
            total += values[i] ** 2
            bits >>= 10
    values[largest] = math.sqrt(max(1.0 - total, 0.0))
    return values[0], values[1], values[2], values[3]

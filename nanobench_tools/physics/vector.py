"""Three-component algebra over lists of components (floats, arrays of a batch, CasADi scalars)."""

from collections.abc import Sequence
from typing import Any

Components = Sequence[Any]


def cross(a: Components, b: Components) -> list[Any]:
    """a x b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def add(a: Components, b: Components) -> list[Any]:
    """Element by element, any length."""
    return [x + y for x, y in zip(a, b, strict=True)]


def subtract(a: Components, b: Components) -> list[Any]:
    """Element by element, any length."""
    return [x - y for x, y in zip(a, b, strict=True)]


def scale(factor: Any, a: Components) -> list[Any]:
    """A number times every element."""
    return [factor * x for x in a]


def total(a: Components) -> Any:
    """Sum of the elements."""
    result = a[0]
    for x in a[1:]:
        result = result + x
    return result


def polynomial(coefficients: Components, x: Any) -> Any:
    """sum_k c_k x^k by Horner; the coefficients start at k = 0."""
    result = coefficients[-1] + 0.0 * x
    for c in reversed(coefficients[:-1]):
        result = result * x + c
    return result


def rotation(quaternion: Components) -> list[list[Any]]:
    """Quaternion x, y, z, w (body to world) -> rows of the rotation matrix.

    A rotation for any length: the stages of an integration leave the unit sphere a little.
    """
    x, y, z, w = quaternion
    twice = 2.0 / (x * x + y * y + z * z + w * w)
    x2, y2, z2 = twice * x, twice * y, twice * z
    xx, yy, zz, xy, xz, yz = x * x2, y * y2, z * z2, x * y2, x * z2, y * z2
    wx, wy, wz = w * x2, w * y2, w * z2
    return [[1.0 - (yy + zz), xy - wz, xz + wy],
            [xy + wz, 1.0 - (xx + zz), yz - wx],
            [xz - wy, yz + wx, 1.0 - (xx + yy)]]


def apply(matrix: Sequence[Components], v: Components) -> list[Any]:
    """M v."""
    return [row[0] * v[0] + row[1] * v[1] + row[2] * v[2] for row in matrix]


def apply_transposed(matrix: Sequence[Components], v: Components) -> list[Any]:
    """M^T v."""
    return [matrix[0][i] * v[0] + matrix[1][i] * v[1] + matrix[2][i] * v[2] for i in range(3)]

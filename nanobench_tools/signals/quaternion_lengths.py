"""Elements of quaternions that are not in one unit: their length shows which one is scaled."""

import numpy as np

from ..settings import number

STREAMS = {"mocap": ("qx", "qy", "qz", "qw"), "attitude_qw": ("qx", "qy", "qz", "qw")}
PART_OFF = number("audit.quaternion_lengths.part_off")
PART_FITS = number("audit.quaternion_lengths.part_fits")

LENGTH_OFF = number("audit.quaternion_lengths.length_off")


def scaled_part(quaternion: np.ndarray) -> tuple[int, float] | None:
    """Which element of (n, 4) quaternions is how many times too large, where that alone keeps their length from 1; None
    where their length is 1, or no single element explains it."""
    squares = quaternion[np.isfinite(quaternion).all(axis=1)] ** 2
    if len(squares) < 20:
        return None
    away = np.abs(squares.sum(axis=1) - 1.0)
    squares = squares[away <= np.quantile(away, 0.98)]  # single rows may be broken
    off = _usual(squares.sum(axis=1) - 1.0)
    if off < PART_OFF:
        return None
    best, left = (0, 1.0), np.inf
    for k in range(squares.shape[1]):
        rest = 1.0 - (squares.sum(axis=1) - squares[:, k])
        power = float(squares[:, k] @ squares[:, k])
        scale = float(squares[:, k] @ rest) / power if power > 0.0 else 0.0
        error = _usual(rest - scale * squares[:, k])
        if scale > 0.0 and error < left:
            best, left = (k, scale ** -0.5), error
    return best if left < PART_FITS * off else None


def other_length(quaternion: np.ndarray) -> float | None:
    """Median length of (n, 4) quaternions where it is steady and is not 1: they are no rotations; else None."""
    length = np.linalg.norm(quaternion[np.isfinite(quaternion).all(axis=1)], axis=1)
    if len(length) < 20:
        return None
    low, middle, high = np.quantile(length, (0.05, 0.5, 0.95))
    return float(middle) if abs(middle - 1.0) > max(LENGTH_OFF, high - low) else None


def _usual(values: np.ndarray) -> float:
    return float(np.quantile(np.abs(values), 0.75))

"""Tracked positions without an attitude, and the log of the same flight on another clock.

The coarse offset aligns the speeds of the tracked and the estimated positions, which depend neither on the frames nor
on the start of time. The fine offset is the one at which a turn about the vertical and a shift explain most. It
includes the delay of the estimate, 6 to 40 ms on seven NanoBench flights whose clocks were known.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.signal import savgol_filter

from ...errors import InputError
from ...flight import Flight, Stream
from ...settings import number
from ...signals.mocap_derivatives import STEP_S

TRACKED, ESTIMATED = ("px", "py", "pz"), ("x", "y", "z")
WINDOW_ROWS = 31
"""Rows of STEP_S over which a velocity is taken, 0.3 s: slower than the noise of an estimate."""
FINE_S = np.arange(-0.06, 0.0601, 0.002)
LARGEST_SHARE = number("retiming.pairing_by_speed.largest_share")
Offset = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray, str], float]


def with_positions(flight: Flight, tracked: Flight, coarse_offset: Offset) -> Flight:
    """``flight`` with the tracked positions on its clock, turned about the vertical onto the estimate's axes.

    InputError, naming the files, when the recordings are not of one flight or the offset is not unique.
    """
    place = f"{flight.provenance.path} with {tracked.provenance.path}"
    if "estimator" not in flight or not all(q in flight["estimator"] for q in ESTIMATED):
        raise InputError(place, "the poses have no attitude, and the log has no estimated position to compare with",
                         "log stateEstimate.x, y, z, or track the attitude")
    seen, true = _grid(flight["estimator"], ESTIMATED), _grid(tracked["mocap"], TRACKED)
    if min(len(seen[0]), len(true[0])) < 2 * WINDOW_ROWS:
        raise InputError(place, "less than a second of positions")
    velocity = [savgol_filter(p, WINDOW_ROWS, 2, deriv=1, delta=STEP_S, axis=0) for _, p in (seen, true)]
    coarse = coarse_offset(seen[0], velocity[0], true[0], velocity[1], place)
    fits = [_fit(seen, (true[0] + coarse + fine, true[1])) for fine in FINE_S]
    best = int(np.argmin([error for *_, error, _ in fits]))
    yaw, shift, error, spread = fits[best]
    if not error < LARGEST_SHARE * spread:
        raise InputError(place, f"tracked and estimated positions differ by {error:.2f} m (RMS) where they spread over "
                         f"{spread:.2f} m", "give recordings of one flight")
    mocap = tracked["mocap"]
    offset_s = coarse + float(FINE_S[best])
    values = mocap.values.copy()
    at = [mocap.index(q) for q in TRACKED]
    values[:, at] = values[:, at] @ _about_z(yaw).T + shift
    note = (f"motion capture of {tracked.provenance.path}, its timestamps later by {offset_s:.3f} s, turned by "
            f"{np.degrees(yaw):.1f} deg about the vertical onto the estimate. Then they differ by {error:.3f} m (RMS). "
            "The delay of the estimate is part of this offset, so errors along the track come out too small")
    moved = replace(mocap, time_s=mocap.time_s + offset_s, values=values)
    return replace(flight.with_streams(mocap=moved),
                   provenance=replace(flight.provenance, notes=(*flight.provenance.notes, note)))


def _grid(stream: Stream, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Times every STEP_S and positions (n, 3) there, without rows that hold none."""
    values = stream[names]
    known = np.isfinite(values).all(axis=1) & np.isfinite(stream.time_s)
    time_s, values = stream.time_s[known], values[known]
    rising = np.concatenate(([True], time_s[1:] > np.maximum.accumulate(time_s)[:-1])) if len(time_s) else known[:0]
    time_s, values = time_s[rising], values[rising]
    if len(time_s) < 2:
        return np.zeros(0), np.zeros((0, 3))
    grid = np.arange(time_s[0], time_s[-1], STEP_S)
    return grid, np.stack([np.interp(grid, time_s, column) for column in values.T], axis=1)


def _fit(seen: tuple[np.ndarray, np.ndarray],
         true: tuple[np.ndarray, np.ndarray]) -> tuple[float, np.ndarray, float, float]:
    """Turn about z and shift (3,) that take the tracked positions onto the estimate; RMS of what is left and of the
    estimate about its mean, m."""
    inside = (seen[0] > true[0][0]) & (seen[0] < true[0][-1])
    if inside.sum() < WINDOW_ROWS:
        return 0.0, np.zeros(3), np.inf, 0.0
    a = seen[1][inside]
    b = np.stack([np.interp(seen[0][inside], true[0], column) for column in true[1].T], axis=1)
    da, db = a - a.mean(axis=0), b - b.mean(axis=0)
    yaw = float(np.arctan2(np.sum(db[:, 0] * da[:, 1] - db[:, 1] * da[:, 0]), np.sum(db[:, :2] * da[:, :2])))
    turned = db @ _about_z(yaw).T
    shift = a.mean(axis=0) - b.mean(axis=0) @ _about_z(yaw).T
    return (yaw, shift, float(np.sqrt(np.mean(np.sum((da - turned) ** 2, axis=1)))),
            float(np.sqrt(np.mean(np.sum(da**2, axis=1)))))


def _about_z(yaw: float) -> np.ndarray:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

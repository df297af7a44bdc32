"""The turning of the vehicle by its estimated attitude."""

import numpy as np

from .. import so3
from ..flight import Stream, make_stream
from .context import Context
from .dropouts import alive_until
from .held_poses import ROTATION
from .quaternions import quaternion_orders
from .usable_rows import even_grid, usable_streams

GYRO = ("gyro_x", "gyro_y", "gyro_z")
FEWEST_ROWS = 20
STEP_S = 0.02
TURN_S = 0.1
"""Turning over this time contains little noise of attitude and gyro."""
REACH_S = 0.1
"""Largest delay between the two streams that is tried."""
SHORTEST_S = 2.0
EULER = ("roll", "pitch", "yaw")


def estimated_attitude(context: Context) -> Stream | None:
    """The vehicle's estimate of its attitude as quaternions x, y, z, w, from whichever form was logged."""
    streams = context.once(usable_streams)
    if "attitude_qw" in streams and all(q in streams["attitude_qw"] for q in ROTATION):
        stream, found = streams["attitude_qw"], context.once(quaternion_orders).get("attitude_qw")
        if found is None or found.reading.as_stored:
            return stream
        return make_stream("attitude_qw", stream.time_s, found.reading.of(stream[ROTATION]), ROTATION)
    angles = streams.get("attitude")
    if angles is None or not all(q in angles for q in EULER):
        return None
    return make_stream("attitude_qw", angles.time_s, so3.from_euler_zyx(*angles[EULER].T), ROTATION)


def rates_of(turn: Stream) -> tuple[np.ndarray, np.ndarray]:
    """times (n,) s and body rates (n, 3) rad/s between rows of an attitude."""
    q = so3.make_continuous(turn[ROTATION])
    step = np.diff(turn.time_s)
    known = (step > 0.0) & np.isfinite(q[1:]).all(axis=1) & np.isfinite(q[:-1]).all(axis=1)
    between = so3.multiply(so3.conjugate(q[:-1][known]), q[1:][known])
    return 0.5 * (turn.time_s[1:] + turn.time_s[:-1])[known], so3.log(between) / step[known, None]


def known_gyro(context: Context) -> tuple[np.ndarray, np.ndarray] | None:
    """times (n,) s and rates (n, 3) rad/s of the gyro until its log ends; None without one."""
    imu = context.once(usable_streams).get("imu")
    if imu is None or not all(q in imu for q in GYRO):
        return None
    known = np.isfinite(imu[GYRO]).all(axis=1) & (imu.time_s <= context.once(alive_until)["imu"])
    return (imu.time_s[known], imu[GYRO][known]) if known.sum() >= FEWEST_ROWS else None


def known_estimate(context: Context) -> Stream | None:
    """The estimated attitude until its log ends; None without one."""
    estimate = estimated_attitude(context)
    if estimate is None:
        return None
    name = "attitude_qw" if "attitude_qw" in context.flight else "attitude"
    known = np.isfinite(estimate[ROTATION]).all(axis=1) & (
        estimate.time_s <= context.once(alive_until).get(name, np.inf))
    return estimate.rows(known) if known.sum() >= FEWEST_ROWS else None


def follows_estimate(context: Context) -> tuple[np.ndarray, np.ndarray] | None:
    """Each axis of the gyro against each of the estimated attitude, at the delay of the best match.

    Correlations (3, 3) and ratios of their sizes (3, 3); None without both streams."""
    found, estimate = known_gyro(context), known_estimate(context)
    if found is None or estimate is None:
        return None
    (t, gyro), at, q = found, estimate.time_s, so3.make_continuous(estimate[ROTATION])
    grid = even_grid(max(at[0], t[0]) + REACH_S, min(at[-1], t[-1]) - REACH_S - TURN_S, STEP_S, len(t))
    if len(grid) * STEP_S < SHORTEST_S:
        return None

    def turned_to(times: np.ndarray) -> np.ndarray:
        found = np.stack([np.interp(times, at, v) for v in q.T], axis=1)
        return np.asarray(found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-9))

    turned = so3.log(so3.multiply(so3.conjugate(turned_to(grid)), turned_to(grid + TURN_S)))
    turned -= turned.mean(axis=0)
    angle = np.vstack([np.zeros(3), np.cumsum(0.5 * (gyro[1:] + gyro[:-1]) * np.diff(t)[:, None], axis=0)])
    best: tuple[np.ndarray, np.ndarray] | None = None
    for delay in np.arange(-REACH_S, REACH_S + 0.5 * STEP_S, STEP_S):
        by = np.stack([np.interp(grid + delay + TURN_S, t, a) - np.interp(grid + delay, t, a) for a in angle.T], axis=1)
        by -= by.mean(axis=0)
        sizes = [np.maximum(np.linalg.norm(v, axis=0), 1e-9) for v in (by, turned)]
        follows = by.T @ turned / np.outer(*sizes)
        if best is None or np.abs(follows).max(axis=1).sum() > np.abs(best[0]).max(axis=1).sum():
            best = follows, sizes[0][:, None] / sizes[1][None, :]
    return best

"""Advance of the sender's time between two rows, from two of its streams of which one is the other's rate.

A position advances by velocity times time. Between two rows of the file the sender's clock advanced by dx.r / |r|^2
(dx: increment, r: rate). The file's clock advanced by dt, so the delay grew by dt - dx.r / |r|^2. No motion capture is
used. The noise is the part of the increment across the rate, where time cannot act.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from ... import so3
from ...flight import Stream
from ...settings import count, number
from ...signals.context import Context
from ...signals.usable_rows import usable_streams
from ..mathematics.packet_delay import CELL_S
from .evidence import KINDS

FEWEST_ROWS = count("retiming.steps.fewest_rows")
GAP_S = number("retiming.steps.gap_s")

Pair = tuple[np.ndarray, np.ndarray]
"""Increments over each interval (n - 1, 3) and rates in it (n - 1, 3), in the same unit but for the second."""


@dataclass(frozen=True)
class StepKind:
    """``needs``: the kinds of evidence that must be used (``evidence.KINDS``). ``slowest``: rates below it are
    uninformative, unit of the rate. ``slow_error_s``: a rate has slow errors (bias, scale). Over this time the clock's
    error averages out, so that the increments show the rate's error. ``weight``: weight of a row, since neighbouring
    errors are correlated."""

    name: str
    needs: tuple[str, ...]
    slowest: float
    slow_error_s: float
    weight: float
    pair: Callable[[dict[str, Stream], np.ndarray], Pair | None]


def _of(streams: dict[str, Stream], name: str, quantities: tuple[str, ...], rows_s: np.ndarray) -> np.ndarray | None:
    stream = streams.get(name)
    if stream is None or not set(quantities) <= set(stream.quantities):
        return None
    return stream.interpolate(quantities, rows_s)


def _middle(values: np.ndarray) -> np.ndarray:
    return np.asarray(0.5 * (values[1:] + values[:-1]))


def _position(streams: dict[str, Stream], rows_s: np.ndarray) -> Pair | None:
    position = _of(streams, "estimator", ("x", "y", "z"), rows_s)
    velocity = _of(streams, "estimator", ("vx", "vy", "vz"), rows_s)
    return None if position is None or velocity is None else (np.diff(position, axis=0), _middle(velocity))


def _quaternion(streams: dict[str, Stream], rows_s: np.ndarray) -> np.ndarray | None:
    stream = streams.get("attitude_qw")
    names = ("qx", "qy", "qz", "qw")
    if stream is None or not set(names) <= set(stream.quantities):
        return None
    return so3.interpolate(stream.time_s, so3.make_continuous(stream[names]), rows_s)


def _attitude(streams: dict[str, Stream], rows_s: np.ndarray) -> Pair | None:
    quaternion, gyro = _quaternion(streams, rows_s), _of(streams, "imu", ("gyro_x", "gyro_y", "gyro_z"), rows_s)
    if quaternion is None or gyro is None:
        return None
    return so3.log(so3.multiply(so3.conjugate(quaternion[:-1]), quaternion[1:])), _middle(gyro)


STEP_KINDS: dict[str, StepKind] = {kind.name: kind for kind in (
    StepKind("position against velocity", ("position", "velocity"), number("retiming.steps.position_slowest_m_s"),
             number("retiming.steps.position_slow_error_s"), 1.0, _position),
    StepKind("attitude against gyro", ("attitude", "gyro"), number("retiming.steps.attitude_slowest_rad_s"),
             number("retiming.steps.attitude_slow_error_s"), number("retiming.steps.attitude_weight"), _attitude),
)}


def log_likelihood_of_steps(context: Context, voting: tuple[str, ...], rows_s: np.ndarray, steps_s: np.ndarray,
                            causal: bool) -> np.ndarray | None:
    """(n, b) log likelihood of each step of the delay at each row from every pair whose streams are all ``voting``;
    None without one."""
    streams = context.once(usable_streams)
    total = None
    for kind in STEP_KINDS.values():
        pair = kind.pair(streams, rows_s) if set(kind.needs) <= set(voting) else None
        if pair is None:
            continue
        found = log_steps(steps_s, rows_s, *pair, kind.slowest, kind.slow_error_s, kind.weight, causal)
        for name in {KINDS[need].stream for need in kind.needs}:
            found[_in_hole(streams[name], rows_s)] = 0.0
        total = found if total is None else total + found
    return total


def _in_hole(stream: Stream, rows_s: np.ndarray) -> np.ndarray:
    """(n,) bool: rows that lie between samples further apart than GAP_S."""
    after = np.clip(np.searchsorted(stream.time_s, rows_s), 1, len(stream) - 1)
    return np.asarray(stream.time_s[after] - stream.time_s[after - 1] > GAP_S)


def log_steps(steps_s: np.ndarray, time_s: np.ndarray, increments: np.ndarray, rates: np.ndarray, slowest: float,
              slow_error_s: float, weight: float = 1.0, causal: bool = False) -> np.ndarray:
    """(n, b) log likelihood of each step of the delay; row 0 and rows of rates below ``slowest`` are zero.

    time_s (n,); increments, rates (n - 1, 3) as ``Pair``. Student's t with 6 degrees of freedom.
    """
    result = np.zeros((len(time_s), len(steps_s)))
    dt = np.diff(time_s)[:, None]
    r = without_slow_error(rates, increments / dt, slow_error_s / float(np.median(dt)), causal)
    speed = np.linalg.norm(r, axis=1)
    moving = speed > slowest
    if moving.sum() < FEWEST_ROWS:
        return result
    advance = np.sum(increments * r, axis=1) / np.maximum(speed, slowest) ** 2
    across = np.linalg.norm(increments - advance[:, None] * r, axis=1)[moving]
    sigma = np.median(across) / np.sqrt(2.0 * np.log(2.0))  # median of a Rayleigh variable
    sigma_s = np.hypot(sigma / np.maximum(speed, slowest), CELL_S / np.sqrt(12.0))
    z = (steps_s[None, :] - (dt[:, 0] - advance)[:, None]) / sigma_s[:, None]
    result[1:] = np.where(moving[:, None], -3.0 * weight * np.log1p(z * z / 6.0), 0.0)
    return result


def without_slow_error(rates: np.ndarray, advance: np.ndarray, rows: float, causal: bool) -> np.ndarray:
    """(n, 3): fast part of ``rates``, slow part of the increments' ``advance`` (n, 3) per time of the file; ``rows``:
    width of the average (standard deviation, or time constant of a causal one)."""
    error = advance - rates
    if causal:
        keep = np.exp(-1.0 / rows)
        return np.asarray(rates + lfilter([1.0 - keep], [1.0, -keep], error, axis=0))
    return np.asarray(rates + gaussian_filter1d(error, rows, axis=0))

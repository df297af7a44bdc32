"""Which signals are compared with what the motion capture predicts for them, each once."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .. import so3
from ..settings import number, setting
from ..time_offsets.mathematics.lags import LagSums, lag_sums
from .context import Context
from .mocap_derivatives import STEP_S, body_rate
from .paired_signals import FORCE_BAND_HZ, POSE_BAND_HZ, RATE_BAND_HZ, REACH_S, Pair, against
from .quaternion_reading import AS_STORED
from .quaternions import quaternion_orders

SHORT_REACH_S = number("audit.pairs.short_reach_s")
COMMANDED_BAND_HZ = setting("audit.pairs.commanded_band_hz")
EULER_BAND_HZ = setting("audit.pairs.euler_band_hz")


def _rate_of_euler(angles: np.ndarray) -> np.ndarray:
    return np.asarray(np.gradient(angles, STEP_S, axis=0))


def _rate_of_quaternion(q: np.ndarray) -> np.ndarray:
    return body_rate(so3.make_continuous(q / np.maximum(np.linalg.norm(q, axis=1, keepdims=True), 1e-9)), STEP_S)


def gyro_pair(context: Context) -> Pair | None:
    """Gyro against the body rate of the motion capture, rad/s."""
    return against(context, "imu", ("gyro_x", "gyro_y", "gyro_z"), lambda truth: truth.rate_rad_s, RATE_BAND_HZ, True)


def force_pair(context: Context) -> Pair | None:
    """Accelerometer against the specific force of the motion capture, m/s^2 body."""
    return against(context, "imu", ("acc_x", "acc_y", "acc_z"), lambda truth: truth.force_m_s2, FORCE_BAND_HZ, True)


def attitude_pair(context: Context) -> Pair | None:
    """Rates of the estimated Euler angles against those of the motion capture, rad/s."""
    return against(context, "attitude", ("roll", "pitch", "yaw"), lambda truth: _rate_of_euler(truth.euler_rad),
                   RATE_BAND_HZ, True, signal=_rate_of_euler, prepare=lambda v: np.unwrap(v, axis=0))


def attitude_qw_pair(context: Context) -> Pair | None:
    """Body rate of the estimated quaternion against that of the motion capture, rad/s."""
    found = context.once(quaternion_orders).get("attitude_qw")
    reading = found.reading if found else AS_STORED
    pair = against(context, "attitude_qw", ("qx", "qy", "qz", "qw"), lambda truth: truth.rate_rad_s, RATE_BAND_HZ, True,
                   signal=_rate_of_quaternion, prepare=lambda q: so3.make_continuous(reading.of(q)))
    return None if pair is None else replace(pair, quantities=("qx", "qy", "qz"))


def position_pair(context: Context) -> Pair | None:
    """Estimated against tracked position, m world."""
    return against(context, "estimator", ("x", "y", "z"), lambda truth: truth.position_m, POSE_BAND_HZ, False)


def velocity_pair(context: Context) -> Pair | None:
    """Estimated against tracked velocity, m/s world."""
    return against(context, "estimator", ("vx", "vy", "vz"), lambda truth: truth.velocity_m_s, POSE_BAND_HZ, False)


def acceleration_pair(context: Context) -> Pair | None:
    """Estimated against tracked acceleration, m/s^2 world."""
    return against(context, "estimator_acc", ("ax", "ay", "az"), lambda truth: truth.acceleration_m_s2, RATE_BAND_HZ,
                   True)


def setpoint_pair(context: Context) -> Pair | None:
    """Position asked for, half a second before (vehicles follow 0.3-0.8 s behind), against that reached, m world."""
    return against(context, "setpoint", ("x", "y", "z"), lambda truth: truth.position_m, COMMANDED_BAND_HZ, True,
                   reach_s=0.5, shift_s=0.5)


def request_pair(context: Context) -> Pair | None:
    """Attitude asked for by the position loop against that reached, rad."""
    return _euler_pair(context, "pid")


def mocap_velocity_pair(context: Context) -> Pair | None:
    """Velocity columns of the motion capture against its positions, m/s world."""
    return against(context, "mocap", ("vx", "vy", "vz"), lambda truth: truth.velocity_m_s, POSE_BAND_HZ, True,
                   reach_s=SHORT_REACH_S)


def mocap_rate_pair(context: Context) -> Pair | None:
    """Rate columns of the motion capture against its quaternions, rad/s body."""
    return against(context, "mocap", ("wx", "wy", "wz"), lambda truth: truth.rate_rad_s, RATE_BAND_HZ, True,
                   reach_s=SHORT_REACH_S)


def euler_column_pair(context: Context) -> Pair | None:
    """Euler columns of the motion capture against its quaternions, rad."""
    return _euler_pair(context, "mocap", reach_s=SHORT_REACH_S)


def _euler_pair(context: Context, stream: str, reach_s: float = REACH_S) -> Pair | None:
    """Euler angles of a stream against those of the motion capture, rad."""
    return against(context, stream, ("roll", "pitch", "yaw"), lambda truth: truth.euler_rad, EULER_BAND_HZ, True,
                   prepare=lambda v: np.unwrap(v, axis=0), reach_s=reach_s)


MakePair = Callable[[Context], Pair | None]
PAIRS: tuple[MakePair, ...] = (gyro_pair, force_pair, attitude_pair, attitude_qw_pair, position_pair, velocity_pair,
                               acceleration_pair, setpoint_pair, request_pair, mocap_velocity_pair, mocap_rate_pair,
                               euler_column_pair)


def sums_of(context: Context, pair: MakePair) -> LagSums | None:
    """Lagged second moments of one of PAIRS, kept with the context."""
    return context.once(pair_sums)[pair]


def pair_sums(context: Context) -> dict[MakePair, LagSums | None]:
    """Lagged second moments of all PAIRS; None for a pair that cannot be formed."""
    result = {}
    for make in PAIRS:
        pair = context.once(make)
        result[make] = None if pair is None else lag_sums(pair.measured, pair.reference, pair.use, STEP_S, pair.reach_s)
    return result

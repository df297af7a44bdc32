"""Input of a smoother from a flight: IMU rows, poses at the times they were measured, and the times of its states."""

import math
from dataclasses import dataclass

import numpy as np

from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight
from nanobench_tools.settings import count, number
from nanobench_tools.sources.interpolation import carries_no_packet, count_packets

from ..drag_ekf import TUNED
from ..imu_noise import packet_rate_hz
from ..inertial import lifted
from ..radio_clock import lateness

ACC = ("acc_x", "acc_y", "acc_z")
GYRO = ("gyro_x", "gyro_y", "gyro_z")
POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
STEP_S = number("smoothers.smoother_rows.step_s")

NEAR_S = number("smoothers.smoother_rows.near_s")

WARMS_M_S3 = TUNED["slope_mean"]
"""By how much the bias of the vertical accelerometer rises as the board warms."""

LEAST_POSES = count("smoothers.smoother_rows.least_poses")
LEAST_S = number("smoothers.smoother_rows.least_s")
GAP_S = number("smoothers.smoother_rows.gap_s")


@dataclass(frozen=True)
class Rows:
    """Rows of the IMU and the poses.

    - report_s (n,): timestamps of the IMU rows.
    - time_s (n,): those less the delay that missing packets show; acc [m/s^2] and gyro [rad/s] (n, 3).
    - packets (n,): number of packets per row (less than one for an interpolated row).
    - poses: pose_s (m,) time of measurement, position (m, 3), quaternion (m, 4), noise_m the stated SD of a position,
      or nan.
    - lift (n,): whether a row is the first in the air, where the accelerometer's biases change."""

    report_s: np.ndarray
    time_s: np.ndarray
    acc: np.ndarray
    gyro: np.ndarray
    packets: np.ndarray
    pose_s: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    noise_m: float
    place: str
    lift: np.ndarray


def rows_of(flight: Flight, causal: bool = False) -> Rows:
    """InputError without an IMU, with a hole in it, or without a second of poses to start from.

    Rows with nan, rows whose time does not rise and the straight line that a resampler draws after the last packet are
    left out. A late pose is used at the time it was measured, if the delay is known (``metadata["pose_delay_s"]``).
    The drift of a warming accelerometer is taken out. ``causal``: packets are not counted, which takes the whole
    recording.
    """
    place = flight.provenance.path
    imu, mocap = flight["imu"], flight["mocap"]
    pose_s = mocap.time_s - float(flight.metadata.get("pose_delay_s", 0.0))
    poses = mocap[POSE]
    good = np.isfinite(poses).all(axis=1) & np.isfinite(pose_s) & (np.linalg.norm(poses[:, 3:], axis=1) > 0.5)
    pose_s, poses = _rising(pose_s[good], poses[good])
    packets, logged = np.ones(len(imu)), np.ones(len(imu), bool)
    if not causal:
        packets = _packets(imu.time_s, imu[ACC + GYRO], packet_rate_hz(imu))
        logged = imu.time_s <= count_packets(imu.time_s, imu[ACC + GYRO]).last_s
    late = lateness(flight) if imu.time_sd_s is None else np.zeros(len(imu))  # re-timed: no delay is left
    good = logged & np.isfinite(imu[ACC + GYRO]).all(axis=1) & np.isfinite(imu.time_s)
    values = np.column_stack([imu[ACC + GYRO], packets, late, imu.time_s])[good]
    values = _rising(values[:, 8], values)[1]
    time_s, values = _rising(values[:, 8] - values[:, 7], values)
    if len(time_s):
        inside = (pose_s >= time_s[0]) & (pose_s <= time_s[-1])
        pose_s, poses = pose_s[inside], poses[inside]
    if len(pose_s) < LEAST_POSES or pose_s[-1] - pose_s[0] < LEAST_S:
        raise InputError(place, "a smoother needs an IMU and a second of poses to start from",
                         f"there are {len(pose_s)} poses while the IMU ran")
    after = time_s >= pose_s[0]
    holes = np.diff(time_s[after])
    if len(holes) and holes.max() > GAP_S:
        at = time_s[after][int(np.argmax(holes))]
        raise InputError(place, f"the IMU has a hole of {holes.max():.2f} s at {at:.2f} s, no smoother bridges it")
    quaternion = so3.make_continuous(poses[:, 3:] / np.linalg.norm(poses[:, 3:], axis=1, keepdims=True))
    noise_m = float(flight.metadata.get("pose_noise_m", math.nan))
    acc, gyro, packets = values[:, :3].copy(), values[:, 3:6], values[:, 6]
    acc[:, 2] -= WARMS_M_S3 * (time_s - time_s[0])
    lift = lifted(flight, values[:, 8])
    return Rows(values[:, 8], time_s, acc, gyro, packets, pose_s, poses[:, :3], quaternion, noise_m, place, lift)


def _rising(time_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rows that are later than all before them."""
    if not len(time_s):
        return time_s, values
    rising = np.concatenate(([True], time_s[1:] > np.maximum.accumulate(time_s)[:-1]))
    return time_s[rising], values[rising]


def _packets(time_s: np.ndarray, values: np.ndarray, rate_hz: float) -> np.ndarray:
    """(n,) packets a row stands for: none on the chord of its neighbours, the others share what there were."""
    own = ~carries_no_packet(time_s, values)
    span = time_s[-1] - time_s[0] if len(time_s) else 0.0
    share = rate_hz * span / max(np.sum(own), 1) if math.isfinite(rate_hz) else 1.0
    return own * min(share, 1.0)


def stands(rows: Rows) -> np.ndarray:
    """Times (k,) of the states: at poses, never closer than NEAR_S, and at least every STEP_S in between."""
    last_row, final = float(rows.time_s[-1]), float(rows.pose_s[-1])
    times = [float(rows.pose_s[0])]
    for pose_s in rows.pose_s[1:].tolist():
        if pose_s - times[-1] >= NEAR_S and (pose_s == final or final - pose_s >= 0.5 * STEP_S):
            times += _evenly(times[-1], pose_s)
    if final > times[-1]:
        times.append(final)
    return np.array(times + _evenly(final, last_row))


def _evenly(start_s: float, end_s: float) -> list[float]:
    """Times after the start up to the end, steps of about STEP_S."""
    count = max(round((end_s - start_s) / STEP_S), 1) if end_s > start_s else 0
    return [start_s + (end_s - start_s) * k / count for k in range(1, count)] + [end_s] * (count > 0)

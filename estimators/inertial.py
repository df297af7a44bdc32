"""What the inertial rows share: a flight's streams as the compiled filter takes them, and what is refused.

A row is a small class with ``settings`` (``inertial_core.SETTINGS`` says what there is) and the aids it needs.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numba as nb
import numpy as np

from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, Stream
from nanobench_tools.methods import Estimate
from nanobench_tools.settings import count, number, setting
from nanobench_tools.signals.radio_gaps import drawn

from . import inertial_core as core
from .radio_clock import lateness

ACC = ("acc_x", "acc_y", "acc_z")
GYRO = ("gyro_x", "gyro_y", "gyro_z")
POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
MOTORS = ("m1", "m2", "m3", "m4")

HOLE_S = number("estimators.inertial.hole_s")
LEAST_S = number("estimators.inertial.least_s")
LEAST_POSES = count("estimators.inertial.least_poses")
BACK_S = number("estimators.inertial.back_s")

COMPARED_S = number("estimators.inertial.compared_s")
LEAST_TURN_RAD = number("estimators.inertial.least_turn_rad")
"""Gyro and poses are compared by how far they turn in COMPARED_S, if that is more than this (RMS)."""
LEAST_ALIKE = number("estimators.inertial.least_alike")
LEAST_ROWS = count("estimators.inertial.least_rows")
SETTLED_S = number("estimators.inertial.settled_s")
COMPARED_EVERY_S = number("estimators.inertial.compared_every_s")
LEVEL_M_S2: tuple[float, float] = setting("estimators.inertial.level_m_s2")
TURN_RATIO: tuple[float, float] = setting("estimators.inertial.turn_ratio")
DEGREES_RATIO = number("estimators.inertial.degrees_ratio")

STAMP_LEFT = number("estimators.inertial.stamp_left")

LIFT_RATIO = number("estimators.inertial.lift_ratio")
OFF_RATIO = number("estimators.inertial.off_ratio")
"""Mean PWM ratio above which a vehicle on the ground is taken to fly, until it falls below the second."""


NOTHING = np.zeros((0, 6))


@dataclass(frozen=True)
class Rows:
    """IMU rows (n,) from the first pose on, and the poses (m,) as they arrive. ``clock_s``: timestamps less the delay
    that the missing packets show. drawn: fraction of the previous row without a packet."""

    time_s: np.ndarray
    clock_s: np.ndarray
    acc: np.ndarray
    gyro: np.ndarray
    drawn: np.ndarray
    flying: np.ndarray
    arrived: np.ndarray
    pose_s: np.ndarray
    poses: np.ndarray


class Inertial:
    """An error-state Kalman filter; subclasses set ``name`` and their settings.

    Attributes
    ----------
    name : str
        Registered name.
    causal : bool
        True: an estimate at t uses only data up to t.
    settings : mapping
        Changes to ``inertial_core.SETTINGS``, SI.
    needs : tuple of str
        Streams that it needs in addition to IMU and poses.
    """

    name = "inertial"
    causal = True
    settings: ClassVar[Mapping[str, float]] = {}
    radio = True
    """Whether timestamps are corrected by missing packets."""
    needs: ClassVar[tuple[str, ...]] = ()
    """Streams that its aids need in addition to the IMU."""
    keep_covariance = True

    def estimate(self, flight: Flight) -> Estimate:
        """Estimate the trajectory of one flight.

        Parameters
        ----------
        flight : Flight
            Uses ``imu`` (gyro [rad/s] and specific force [m/s^2], body) and the poses in ``mocap``. ``metadata`` may
            have ``pose_delay_s`` and ``pose_noise_m``.

        Returns
        -------
        Estimate
            At the rows of the IMU: position, velocity, attitude, covariance (n, 9, 9), and innovations of the poses.

        Raises
        ------
        InputError
            Without IMU, a second of poses, or a stream of ``needs``. Also for a hole in the IMU, and for units or axes
            that the poses contradict.
        """
        for stream, quantity in (("motor", "m1"), ("battery", "vbat")):
            if stream in self.needs and (stream not in flight or quantity not in flight[stream]):
                raise InputError(flight.provenance.path, f"has no {stream} stream, which {self.name} needs",
                                 "rows without it go on")
        retimed = flight["imu"].time_sd_s is not None
        rows = rows_of(flight, self.radio and not retimed)
        values = values_of(settings_of(self.settings, flight))
        return run(rows, values, self.keep_covariance, self.measured(flight, rows))

    def measured(self, flight: Flight, rows: Rows) -> np.ndarray:
        """Body velocity at the rows from elsewhere, as ``inertial_core.run`` takes it; (0, 6) for none."""
        return NOTHING


def settings_of(settings: Mapping[str, float], flight: Flight) -> dict[str, float]:
    """Settings of a row for one flight: less clock wander after a correction, more noise of poses if requested."""
    found = {**core.SETTINGS, **settings}
    if flight["imu"].time_sd_s is not None:
        found["stamp"] *= STAMP_LEFT
    found["position_sd"] = float(np.hypot(found["position_sd"], float(flight.metadata.get("pose_noise_m", 0.0))))
    return found


def values_of(settings: Mapping[str, float]) -> np.ndarray:
    """The settings as the core takes them; KeyError for one that it does not have."""
    if unknown := set(settings) - set(core.SETTINGS):
        raise KeyError(f"no such setting: {', '.join(sorted(unknown))}")
    return np.array([float({**core.SETTINGS, **settings}[name]) for name in core.NAMES])


def run(rows: Rows, values: np.ndarray, keep_covariance: bool = True, measured: np.ndarray = NOTHING) -> Estimate:
    """The filter over all rows; covariance of position, velocity and attitude (n, 9, 9) where it is kept; ``measured``
    as in the core."""
    n = len(rows.time_s)
    state, cov = np.zeros(core.STATE), np.zeros((core.ERROR, core.ERROR))
    core.start(rows.poses[0], values, state, cov)
    out = np.empty((n, 11))
    kept = np.empty((n if keep_covariance else 0, 9, 9))
    core.run(rows.time_s, rows.clock_s, rows.acc, rows.gyro, rows.drawn, rows.flying, measured, rows.arrived,
             rows.pose_s, rows.poses, values, 0, state, cov, np.zeros((n, 6)), np.zeros((n, 4)), out, kept)
    nis = out[:, 10][np.isfinite(out[:, 10])]
    return Estimate(rows.time_s, out[:, :3], out[:, 6:10], out[:, 3:6], kept if keep_covariance else None, nis,
                    np.full(len(nis), 3))


def rows_of(flight: Flight, radio: bool = True) -> Rows:
    """What the core needs of a flight. InputError as ``Inertial.estimate`` says."""
    place = flight.provenance.path
    imu, mocap = flight["imu"], flight["mocap"]
    if not all(name in imu for name in ACC + GYRO):
        raise InputError(place, "dead reckoning needs an accelerometer and a gyro of three axes")
    pose_s, poses = _poses(mocap)
    good = _rising(place, imu.time_s, np.isfinite(imu[ACC + GYRO]).all(axis=1) & np.isfinite(imu.time_s))
    if len(pose_s):
        good &= imu.time_s >= pose_s[0]
    time_s = imu.time_s[good]
    if len(pose_s) < LEAST_POSES or len(time_s) < 2 or pose_s[-1] - pose_s[0] < LEAST_S:
        raise InputError(place, "dead reckoning needs an IMU and a second of poses to start from")
    hole = int(np.argmax(np.diff(time_s)))
    if time_s[hole + 1] - time_s[hole] > HOLE_S:
        size = time_s[hole + 1] - time_s[hole]
        raise InputError(place, f"the IMU has a hole of {size:.2f} s at {time_s[hole]:.2f} s",
                         f"no filter reckons over more than {HOLE_S} s")
    acc, gyro = np.ascontiguousarray(imu[ACC][good]), np.ascontiguousarray(imu[GYRO][good])
    measured_s = pose_s - float(flight.metadata.get("pose_delay_s", 0.0))
    _check(place, time_s, acc, gyro, measured_s, poses)
    clock_s, lines = time_s, np.zeros(len(time_s))
    if radio:
        lines = np.concatenate(([0.0], drawn(flight)[:-1]))[good]
        clock_s = np.maximum.accumulate(time_s - lateness(flight)[good])
    arrived = np.concatenate(([0], np.searchsorted(pose_s, time_s, side="right"))).astype(np.int64)
    ratio = held(flight["motor"], MOTORS, time_s).mean(axis=1) if _has_motors(flight) else np.ones(len(time_s))
    flying = _flown(ratio, LIFT_RATIO, OFF_RATIO) if "motor" in flight else np.ones(len(time_s), bool)
    return Rows(time_s, clock_s, acc, gyro, lines, flying, arrived, measured_s, poses)


def lifted(flight: Flight, time_s: np.ndarray) -> np.ndarray:
    """(n,) bool at ``time_s``: the first airborne row of each lift-off, from the motors' PWM known at that time. All
    False without motors."""
    found = np.zeros(len(time_s), bool)
    if _has_motors(flight) and len(time_s):
        flying = _flown(held(flight["motor"], MOTORS, time_s).mean(axis=1), LIFT_RATIO, OFF_RATIO)
        found[1:] = flying[1:] & ~flying[:-1]
    return found


def _has_motors(flight: Flight) -> bool:
    return "motor" in flight and all(name in flight["motor"] for name in MOTORS) and len(flight["motor"]) > 0


def _poses(mocap: Stream) -> tuple[np.ndarray, np.ndarray]:
    """(m,) stamps that rise and (m, 7) poses with signs of the quaternions that go on; rows with nan are left out."""
    poses = mocap[POSE]
    good = np.isfinite(poses).all(axis=1) & np.isfinite(mocap.time_s) & (np.linalg.norm(poses[:, 3:], axis=1) > 0.5)
    time_s, poses = mocap.time_s[good], poses[good]
    rising = np.concatenate(([True], time_s[1:] > np.maximum.accumulate(time_s)[:-1])) if len(time_s) else good[:0]
    time_s, poses = time_s[rising], np.ascontiguousarray(poses[rising])
    poses[:, 3:] = so3.make_continuous(poses[:, 3:] / np.linalg.norm(poses[:, 3:], axis=1, keepdims=True))
    return time_s, poses


def _rising(place: str, time_s: np.ndarray, good: np.ndarray) -> np.ndarray:
    """``good`` (n,) without the rows that are not later than all before; InputError if time really goes back."""
    latest = np.maximum.accumulate(np.where(good, time_s, -np.inf))
    before = np.concatenate(([-np.inf], latest[:-1]))
    back = np.where(good & np.isfinite(before), before - time_s, 0.0)
    if len(back) and back.max() > BACK_S:
        row = int(np.argmax(back))
        raise InputError(place, f"the time of the IMU goes back by {back[row]:.2f} s at {time_s[row]:.2f} s, row {row}")
    return good & (time_s > before)


def held(stream: Stream, names: tuple[str, ...], at_s: np.ndarray) -> np.ndarray:
    """(m, k): the latest finite row not after ``at_s`` (the first one before it)."""
    values = stream[names]
    good = np.isfinite(values).all(axis=1)
    row = np.clip(np.searchsorted(stream.time_s[good], at_s, side="right") - 1, 0, None)
    return values[good][row] if good.any() else np.zeros((len(at_s), len(names)))


@nb.njit(cache=True)
def _flown(ratio: np.ndarray, lift: float, off: float) -> np.ndarray:
    """(n,) bool whether it flies, by the mean PWM ratio (n,) of the motors: from ``lift`` until below ``off``."""
    flying = np.zeros(len(ratio), np.bool_)
    on = False
    for i in range(len(ratio)):
        on = ratio[i] > (off if on else lift)
        flying[i] = on
    return flying


def _check(place: str, time_s: np.ndarray, acc: np.ndarray, gyro: np.ndarray, pose_s: np.ndarray,
           poses: np.ndarray) -> None:
    """InputError if gyro or accelerometer have another unit or sign than the poses that were given."""
    until = int(np.searchsorted(time_s, pose_s[-1]))
    if until < LEAST_ROWS:
        return
    up = so3.matrix(poses[:, 3:])[np.clip(np.searchsorted(pose_s, time_s[:until]), 0, len(pose_s) - 1), 2]
    level = float(np.median(np.sum(up * acc[:until], axis=1)))
    if not LEVEL_M_S2[0] < level < LEVEL_M_S2[1]:
        what = "the other way round" if level < 0.0 else "in another unit"
        raise InputError(place, f"the accelerometer shows {level:.2f} m/s^2 upwards where the poses are given, not "
                         f"about 9.81: an axis may be {what}")
    angle = np.vstack([np.zeros(3), np.cumsum(0.5 * (gyro[1:] + gyro[:-1]) * np.diff(time_s)[:, None], axis=0)])
    at = np.arange(pose_s[0] + SETTLED_S, min(pose_s[-1], time_s[-1]) - COMPARED_S, COMPARED_EVERY_S)
    if len(at) < LEAST_ROWS:
        return
    first, last = np.searchsorted(pose_s, at), np.searchsorted(pose_s, at + COMPARED_S)
    turned = so3.log(so3.multiply(so3.conjugate(poses[first, 3:]), poses[np.minimum(last, len(pose_s) - 1), 3:]))
    by_gyro = np.stack([np.interp(pose_s[np.minimum(last, len(pose_s) - 1)], time_s, angle[:, k])
                        - np.interp(pose_s[first], time_s, angle[:, k]) for k in range(3)], axis=1)
    for k, axis in enumerate("xyz"):
        square = float(np.mean(turned[:, k] ** 2))
        if square < LEAST_TURN_RAD**2:
            continue
        product = float(np.mean(turned[:, k] * by_gyro[:, k]))
        slope, alike = product / square, abs(product) / np.sqrt(square * np.mean(by_gyro[:, k] ** 2) + 1e-30)
        if alike > LEAST_ALIKE and not TURN_RATIO[0] < slope < TURN_RATIO[1]:
            why = "in degrees" if slope > DEGREES_RATIO else "the other way round" if slope < 0.0 else "in another unit"
            raise InputError(place, f"gyro_{axis} turns {slope:.2f} times as far as the poses do: it may be {why}")

"""Prediction windows of one flight: rows at 100 Hz, clean and airborne, never across a lost frame."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .. import so3
from ..errors import UsageError
from ..flight import Flight, Span, Stream, mask_of
from ..methods import Past, Prediction, Windows
from ..metrics.association import SAME_STAMP_S, associate
from ..metrics.prediction import window_starts
from ..settings import number
from . import backward
from .backward import CENTRED_ROWS

RATE_HZ = 100.0
HORIZON = 50
EVERY = 10
PAST = 50
"""Rows of inputs before the start that come with a window: half a second."""
PAST_ALL = 250
"""Rows of all streams before the start for class ``past``: the last 2 s, and half a second of inputs before those."""
LOST_FRAME = number("tasks.windows.lost_frame")

STARTS = ("centred", "past")
"""As published: the stored values at the start, which use some of the 50 ms after it. And with the past alone."""

GYRO = ("gyro_x", "gyro_y", "gyro_z")
FORCE = ("acc_x", "acc_y", "acc_z")

TRUTHS = {"onboard": "attitude_qw", "mocap": "mocap"}
"""Truth of attitude -> the stream it comes from."""


def rows_at_100_hz(flight: Flight, spans: Sequence[Span]) -> tuple[np.ndarray, list[int]]:
    """Timestamps (n,) s of the rows inside ``spans``, and the lengths of the stretches they fall into.

    The motion capture's own rows where they come at 100 Hz, else a 10 ms grid over each span.
    """
    mocap_s = flight["mocap"].time_s
    step = 1.0 / RATE_HZ
    if abs(np.median(np.diff(mocap_s)) - step) < 0.01 * step:
        time_s = mocap_s[mask_of(spans, mocap_s)]
    else:
        grids = [np.arange(max(s.start_s, mocap_s[0]), min(s.end_s, mocap_s[-1]), step) for s in spans]
        time_s = np.concatenate(grids) if grids else np.empty(0)
        time_s = time_s[associate(time_s, mocap_s, *_pose(flight)).kept] if len(time_s) else time_s
    if not len(time_s):
        return time_s, []
    breaks = np.flatnonzero(np.diff(time_s) > LOST_FRAME * step) + 1
    return time_s, np.diff([0, *breaks, len(time_s)]).tolist()


def _pose(flight: Flight) -> tuple[np.ndarray, np.ndarray]:
    mocap = flight["mocap"]
    return mocap["px", "py", "pz"], mocap["qx", "qy", "qz", "qw"]


def _rotations_at(stream: Stream, time_s: np.ndarray) -> np.ndarray:
    """(n, 4) quaternions of a stream at ``time_s``: its own rows where the timestamps are the same, else slerp."""
    quaternion = stream["qx", "qy", "qz", "qw"]
    rows = np.minimum(np.searchsorted(stream.time_s, time_s), len(stream) - 1)
    if np.array_equal(stream.time_s[rows], time_s):
        return quaternion[rows]
    return so3.interpolate(stream.time_s, quaternion, time_s)


def cut_windows(flight: Flight, spans: Sequence[Span], truth: str, past: bool = False, start: str = "centred",
                recorded: Flight | None = None) -> tuple[Windows, Prediction] | None:
    """(what a predictor gets, what came) for all windows of a flight; None when no window fits.

    Start state: mocap position and velocity, gyro rate, attitude from the stream of ``truth`` (key of TRUTHS). Inputs:
    logged PWM and battery of the window and of the PAST rows before it. Where there are fewer rows, the first row of
    its stretch is repeated. The truth of the rate is the gyro, of the attitude the same stream as the start. ``past``
    adds all streams over the PAST_ALL rows before the start.

    start (one of STARTS): ``centred``, the stored rows; ``past``, only data that had arrived by then: velocity from
    poses up to the start. Gyro and onboard attitude come from their newest whole row. They are on the clock of
    ``recorded`` if an estimate from the whole flight moved the streams of ``flight``. What comes, and the inputs, are
    the same.
    """
    if start not in STARTS:
        raise UsageError(f"start is {start!r}; it can be {', '.join(STARTS)}")
    time_s, lengths = rows_at_100_hz(flight, spans)
    starts = window_starts(lengths, HORIZON, EVERY)
    if not len(starts):
        return None
    mocap = flight["mocap"]
    found = associate(time_s, mocap.time_s, *_pose(flight), mocap["vx", "vy", "vz"])
    velocity = np.asarray(found.velocity_m_s)
    quaternion = found.quaternion if truth == "mocap" else _rotations_at(flight[TRUTHS[truth]], time_s)
    quaternion = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    rate = flight["imu"].interpolate(GYRO, time_s)
    motor = flight["motor"].interpolate(("m1", "m2", "m3", "m4"), time_s)
    battery = flight["battery"].interpolate("vbat", time_s)
    ahead = starts[:, None] + np.arange(HORIZON + 1)
    inputs, after = ahead[:, :-1], ahead[:, 1:]
    first = np.repeat(np.cumsum([0, *lengths[:-1]]), lengths)[starts]
    before = np.maximum(starts[:, None] + np.arange(-PAST, 0), first[:, None])
    all_before = None
    if past:
        rows = np.maximum(starts[:, None] + np.arange(-PAST_ALL, 0), first[:, None])
        force = (flight["imu"].interpolate(FORCE, time_s) if all(name in flight["imu"] for name in FORCE)
                 else np.full_like(rate, np.nan))
        all_before = Past(found.position_m[rows], velocity[rows], quaternion[rows], rate[rows], force[rows],
                          motor[rows], battery[rows], np.minimum(starts - first, PAST_ALL))
    windows = Windows(found.position_m[starts], velocity[starts], quaternion[starts], rate[starts], motor[inputs],
                      battery[inputs], RATE_HZ, motor[before], battery[before], all_before)
    if start == "past":
        rows = np.maximum(starts[:, None] + np.arange(-PAST_ALL, 0), first[:, None])
        windows = looking_back(windows, flight if recorded is None else recorded, time_s[starts], time_s[rows], truth)
    return windows, Prediction(found.position_m[after], velocity[after], quaternion[after], rate[after])


def start_times(flight: Flight, spans: Sequence[Span]) -> np.ndarray:
    """(n,) s: timestamps of the starts of all windows that ``cut_windows`` cuts."""
    time_s, lengths = rows_at_100_hz(flight, spans)
    return np.asarray(time_s[window_starts(lengths, HORIZON, EVERY)])


def looking_back(windows: Windows, flight: Flight, at_s: np.ndarray, before_s: np.ndarray, truth: str) -> Windows:
    """``windows`` that start at ``at_s`` (n,) s, their past rows at ``before_s`` (n, PAST_ALL). Also the data of
    ``flight`` that had arrived by then, its streams on the clock they were recorded on. Rows of ``past`` that had not
    come hold the newest that had."""
    mocap, imu, attitude = flight["mocap"], flight["imu"], flight[TRUTHS[truth]]
    back = CENTRED_ROWS - 1
    pose = np.maximum(np.searchsorted(mocap.time_s, at_s + SAME_STAMP_S, side="right") - 1, 0)
    velocity = backward.velocity(mocap.time_s, mocap["px", "py", "pz"], pose, back)
    known = backward.newest(flight, imu, at_s)
    rate = imu[GYRO][known]
    changes: dict[str, Any] = {"velocity_m_s": velocity[:, -1], "rate_rad_s": rate}
    if truth != "mocap":
        seen = backward.newest(flight, attitude, at_s)
        turned = so3.exp(rate * (at_s - attitude.time_s[seen])[:, None])
        quaternion = so3.multiply(attitude["qx", "qy", "qz", "qw"][seen], turned)
        changes["quaternion"] = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    if windows.past is None:
        return replace(windows, **changes)
    past = windows.past
    then_s = np.minimum(before_s, imu.time_s[known][:, None])
    flown = np.arange(-back, 0) >= -past.rows[:, None]
    streams: dict[str, Any] = {"rate_rad_s": imu.interpolate(GYRO, then_s.ravel()).reshape(*then_s.shape, 3)}
    if all(name in imu for name in FORCE):
        streams["specific_force_m_s2"] = imu.interpolate(FORCE, then_s.ravel()).reshape(*then_s.shape, 3)
    if truth != "mocap":
        then_s = np.minimum(then_s, attitude.time_s[seen][:, None])
        held = _rotations_at(attitude, then_s.ravel()).reshape(*then_s.shape, 4)
        streams["quaternion"] = held / np.linalg.norm(held, axis=-1, keepdims=True)
    fast = past.velocity_m_s.copy()
    fast[:, -back:] = np.where(flown[..., None], velocity[:, :-1], fast[:, -back:])
    return replace(windows, past=replace(past, velocity_m_s=fast, **streams), **changes)

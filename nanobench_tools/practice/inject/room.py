"""Faults of the motion capture and of orientation: lost from sight, moved, and quaternions in another order."""

import numpy as np

from ... import so3
from ...auditing.faults.kind import Blind, Injection
from ...flight import Fault, Flight
from ..mocap import WINDOW, body_rate, savgol_derivative
from .place import choose, choose_time, truth, with_values

POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")


def _with_poses(flight: Flight, poses: np.ndarray) -> Flight:
    """The mocap stream with poses (n, 7); derived quantities are computed again within reach of the filters.

    Rows with NaN become NaN as a whole and leave the others as they were.
    """
    s = flight["mocap"]
    values = s.values.copy()
    pose_columns = [s.index(n) for n in POSE]
    new = (poses != values[:, pose_columns]).any(axis=1)
    values[:, pose_columns] = poses
    lost = ~np.isfinite(poses).all(axis=1)
    values[lost] = np.nan
    if not lost.any():
        near = np.convolve(new, np.ones(WINDOW), mode="same") > 0.5
        derived = {("roll", "pitch", "yaw"): (new, so3.euler_zyx(poses[:, 3:])),
                   ("vx", "vy", "vz"): (near, savgol_derivative(s.time_s, poses[:, :3])),
                   ("wx", "wy", "wz"): (near, body_rate(s.time_s, poses[:, 3:]))}
        for names, (rows, made) in derived.items():
            if names[0] in s:
                values[np.ix_(rows, [s.index(n) for n in names])] = made[rows]
    return flight.with_streams(mocap=with_values(s, values))


def mocap_occlusion(flight: Flight, rng: np.random.Generator, size: float = 0.5, *, at_s: float | None = None,
                    how: str | None = None) -> tuple[Flight, Fault]:
    """The vehicle is out of sight for ``size`` s. Its poses are ``repeat`` ed, ``interpolate`` d or ``nan``."""
    how = how or ("repeat", "interpolate", "nan")[int(rng.integers(3))]
    s = flight["mocap"]
    at = choose_time(flight, rng, at_s, size)
    rows = np.flatnonzero((s.time_s > at) & (s.time_s < at + size))
    before, after = rows[0] - 1, min(rows[-1] + 1, len(s) - 1)
    poses = s[list(POSE)].copy()
    if how == "nan":
        poses[rows] = np.nan
    elif how == "repeat":
        poses[rows] = poses[before]
    else:
        ends = s.time_s[[before, after]]
        share = ((s.time_s[rows] - ends[0]) / (ends[1] - ends[0]))[:, None]
        poses[rows, :3] = poses[before, :3] + share * (poses[after, :3] - poses[before, :3])
        poses[rows, 3:] = so3.interpolate(ends, poses[[before, after], 3:], s.time_s[rows])
    span = float(s.time_s[before]), float(s.time_s[after])
    fault = truth("mocap_occlusion", "mocap", POSE, span, span[1] - span[0], "s", f"poses: {how}")
    return _with_poses(flight, poses), fault


def mocap_jump(flight: Flight, rng: np.random.Generator, size: float = 0.1, *, at_s: float | None = None
               ) -> tuple[Flight, Fault]:
    """From a row on, all positions are displaced by ``size`` m in a random direction."""
    s = flight["mocap"]
    i = int(np.searchsorted(s.time_s, choose_time(flight, rng, at_s)))
    way = rng.standard_normal(3)
    poses = s[list(POSE)].copy()
    poses[i:, :3] += size * way / np.linalg.norm(way)
    at = float(s.time_s[i])
    return (_with_poses(flight, poses),
            truth("mocap_jump", "mocap", POSE[:3], (float(s.time_s[i - 1]), at), size, "m", "positions displaced"))


def quaternion_order(flight: Flight, rng: np.random.Generator, size: float | None = None, *, stream: str | None = None
                     ) -> tuple[Flight, Fault]:
    """w, x, y, z in place of x, y, z, w; ``size`` is not used."""
    name = choose(rng, stream, ("mocap", "attitude_qw"), flight)
    s = flight[name]
    columns = [s.index(q) for q in ("qx", "qy", "qz", "qw")]
    values = s.values.copy()
    values[:, columns] = values[:, [columns[3], *columns[:3]]]
    return (flight.with_streams(**{name: with_values(s, values)}),
            truth("quaternion_order", name, [s.columns[i] for i in columns], (s.span.start_s, s.span.end_s),
                  float("nan"), "", "scalar first"))


MOCAP_OCCLUSION = Injection(mocap_occlusion,
                            (0.1, 0.5, 2.0),
                            "s",
                            ({"how": "repeat"}, {"how": "interpolate"}, {"how": "nan"}),
                            blind=(Blind(2.0, {"how": "interpolate"}, False, place=17),))
MOCAP_JUMP = Injection(mocap_jump, (0.02, 0.1, 0.5), "m", blind=(Blind(0.1, {}, False, place=11),))
QUATERNION_ORDER = Injection(quaternion_order,
                             cases=({"stream": "mocap"}, {"stream": "attitude_qw"}),
                             blind=(Blind(None, {"stream": "mocap"}, True, place=10),))

"""The motion capture as the yardstick: its pose and what follows from it, on one even grid of 100 Hz."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from .. import so3
from ..frames import gravity_up
from ..settings import number
from .context import Context
from .flown_axes import tracker_scale
from .held_poses import held_poses
from .pose_frame import posed

STEP_S = number("audit.mocap_derivatives.step_s")

SLOWEST_STEP_S = number("audit.mocap_derivatives.slowest_step_s")

BRIDGED_S = number("audit.mocap_derivatives.bridged_s")
BEND_M = number("audit.mocap_derivatives.bend_m")
BEND_QUATERNION = number("audit.mocap_derivatives.bend_quaternion")


@dataclass(frozen=True)
class MocapDerivatives:
    """Derivatives of the tracked pose.

    - time_s (n,);
    - position_m, velocity_m_s, acceleration_m_s2 (n, 3): world;
    - quaternion (n, 4): body to world; euler_rad (n, 3): roll, pitch, yaw, unwrapped;
    - rate_rad_s and force_m_s2 (specific force) (n, 3): body;
    - good (n,) bool: frames on both sides and no jump near by."""

    time_s: np.ndarray
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    acceleration_m_s2: np.ndarray
    quaternion: np.ndarray
    euler_rad: np.ndarray
    rate_rad_s: np.ndarray
    force_m_s2: np.ndarray
    good: np.ndarray


def derivatives_of(context: Context) -> MocapDerivatives | None:
    """None without poses for at least one second.

    Derivatives are central differences over 20 ms of a cubic spline through the frames, which bridges lost frames
    smoothly. At 8 Hz their gain is 0.96 (first) and 0.98 (second), without delay.
    """
    stream = context.once(posed)
    names = ("px", "py", "pz", "qx", "qy", "qz", "qw")
    held = context.once(held_poses)
    if stream is None or held is None or not all(name in stream.quantities for name in names):
        return None
    pose = stream[names]
    pose = pose / np.array([*[context.once(tracker_scale)] * 3, 1.0, 1.0, 1.0, 1.0])
    keep = ~held.any & (np.abs(pose[:, 3:]).max(axis=1) > 0.1)
    t, pose = stream.time_s[keep], pose[keep]
    if len(t) < 20 or t[-1] - t[0] < 1.0 or (step := float(np.median(np.diff(t)))) > SLOWEST_STEP_S:
        return None
    pose = np.column_stack([pose[:, :3], so3.make_continuous(pose[:, 3:])])
    grid = np.arange(t[0], t[-1], STEP_S)
    on_grid = CubicSpline(t, pose)(grid)
    p, q = on_grid[:, :3], on_grid[:, 3:]
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    gap_after = np.searchsorted(t, grid, side="right")
    bridged_s = max(BRIDGED_S, 1.5 * step)  # between frames of a slow tracker no frame is missing
    missing = t[np.minimum(gap_after, len(t) - 1)] - t[np.maximum(gap_after - 1, 0)] > bridged_s
    v = np.gradient(p, STEP_S, axis=0)
    a = np.zeros_like(p)
    a[1:-1] = np.diff(p, 2, axis=0) / STEP_S**2
    a[0], a[-1] = a[1], a[-2]
    euler = np.unwrap(so3.euler_zyx(q), axis=0)
    return MocapDerivatives(grid, p, v, a, q, euler, body_rate(q, STEP_S), so3.rotate_inverse(q, a + gravity_up()),
                            ~widened(missing | _jumps(p, q), 10))


def body_rate(quaternion: np.ndarray, step_s: float) -> np.ndarray:
    """(n, 4) continuous unit quaternions on an even grid -> (n, 3) body rates [rad/s] by central differences."""
    rate = np.zeros((len(quaternion), 3))
    dq = so3.multiply(so3.conjugate(quaternion[:-2]), quaternion[2:])
    dq = dq * np.sign(dq[:, 3:] + 1e-300)
    length = np.linalg.norm(dq[:, :3], axis=1, keepdims=True)
    # angle / sin(angle / 2), with its limit 2 for small angles
    scale = np.where(length < 1e-6, 2.0, 2.0 * np.arctan2(length, dq[:, 3:]) / np.maximum(length, 1e-12))
    rate[1:-1] = dq[:, :3] * scale / (2.0 * step_s)
    rate[0], rate[-1] = rate[1], rate[-2]
    return rate


def widened(flags: np.ndarray, rows: int) -> np.ndarray:
    """(n,) bool: True also within ``rows`` of a True."""
    if not flags.any():
        return flags
    counts = np.concatenate(([0], np.cumsum(flags)))
    n = len(flags)
    i = np.arange(n)
    return counts[np.minimum(i + rows + 1, n)] > counts[np.maximum(i - rows, 0)]


def _jumps(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Rows at which the pose bends by more than a vehicle can: 30 mm (300 m/s^2) or 0.1 rad between 10 ms frames."""
    flags = np.zeros(len(p), dtype=bool)
    flags[1:-1] = (np.linalg.norm(np.diff(p, 2, axis=0), axis=1) > BEND_M) | (
        np.linalg.norm(np.diff(q, 2, axis=0), axis=1) > BEND_QUATERNION
    )
    return flags

"""Whether the tracked attitude tilts where the path accelerates. It does not if the quaternions are inverted, or if
attitude and position are in worlds that are turned about the vertical."""

import math
from dataclasses import dataclass

import numpy as np

from .. import so3
from ..settings import number
from ..units import GRAVITY_M_S2
from .context import Context
from .flown_axes import BAND_HZ, Axis, ground_axes, tilts
from .flown_axes import UP as UPWARDS
from .mocap_derivatives import derivatives_of
from .paired_signals import FEWEST_ROWS, band_limited, flying_rows

FOLLOWS = number("audit.tilt_heading.follows")
"""Correlation of tilt and acceleration from which on they are compared."""
TURNED_RAD = number("audit.tilt_heading.turned_rad")
"""Angle between tilt and acceleration from which on the attitude is in another frame."""
MIRRORED = number("audit.tilt_heading.mirrored")
FAR_BETTER = number("audit.tilt_heading.far_better")
UP = np.array([0.0, 0.0, 1.0])


def tilt_and_acceleration(context: Context) -> np.ndarray | None:
    """(3, n, 2) m/s^2, world, band-limited, in the air: three horizontal accelerations. They are that of the tracked
    path, that of the tilt, and that of the tilt of the inverted quaternions. None with less than three seconds."""
    truth, use = context.once(derivatives_of), context.once(flying_rows)
    if truth is None or use.sum() < FEWEST_ROWS:
        return None
    tilts = [GRAVITY_M_S2 * turn(truth.quaternion, UP)[:, :2] for turn in (so3.rotate, so3.rotate_inverse)]
    return band_limited(np.stack([truth.acceleration_m_s2[:, :2], *tilts]), (BAND_HZ[0], BAND_HZ[1]))[:, use]


def wrong_heading(context: Context) -> tuple[float, str] | None:
    """Angle [rad] of the turn between attitude and path, and what to do about it in words; None where they agree or
    nothing shows it."""
    both = context.once(tilt_and_acceleration)
    if both is None:
        return None
    path, tilt, inverted = (v[:, 0] + 1j * v[:, 1] for v in both)
    if (mirror := _mirror(both)) is not None and mirror[0] == SWAPPED_AND_NEGATED:
        return math.pi, ("the attitude is in north, east, down (NED, body FRD) and the position has z up: convert the "
                         f"quaternions (correlation {mirror[1]:.2f})")
    angle, follows = _turn(tilt, path)
    if follows < FOLLOWS or abs(angle) < TURNED_RAD:
        back, better = _turn(inverted, path)
        if follows >= FOLLOWS or better < FOLLOWS or abs(back) > TURNED_RAD:
            return None
        return math.pi, f"the quaternions are inverted (world to body): negate x, y, z (correlation {better:.2f})"
    back, better = _turn(inverted, path)
    if better > follows and abs(back) < TURNED_RAD:
        return math.pi, (f"the quaternions are inverted (world to body): negate x, y, z (correlation {better:.2f}; a "
                         f"world turned by {math.degrees(angle):.0f} deg gives {follows:.2f})")
    return abs(angle), (f"the attitude is in a world turned by {math.degrees(angle):.0f} deg about z against that of "
                        f"the position (correlation {follows:.2f})")


def straight(context: Context) -> float:
    """Correlation of tilt and path where they need no turn, else 0."""
    both = context.once(tilt_and_acceleration)
    if both is None:
        return 0.0
    path, tilt = (v[:, 0] + 1j * v[:, 1] for v in both[:2])
    angle, follows = _turn(tilt, path)
    return follows if abs(angle) < TURNED_RAD else 0.0


def followed_axes(context: Context) -> tuple[bool, bool]:
    """Whether the path follows the tilt along x, and along y; one that hardly moves along an axis shows nothing."""
    both = context.once(tilt_and_acceleration)
    if both is None or straight(context) < FOLLOWS:
        return False, False
    size = np.sqrt(np.mean(both[:2] ** 2, axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = np.mean(both[0] * both[1], axis=0) / (size[0] * size[1]) > FOLLOWS
    return bool(x), bool(y)


def half_turned(context: Context) -> bool:
    """Whether the tilt fits the path as well with inverted quaternions: the heading is near half a turn throughout."""
    both = context.once(tilt_and_acceleration)
    if both is None:
        return False
    path, *tilts = (v[:, 0] + 1j * v[:, 1] for v in both)
    found = [_turn(tilt, path) for tilt in tilts]
    return all(follows > FOLLOWS and abs(angle) < TURNED_RAD for angle, follows in found)


def _turn(tilt: np.ndarray, path: np.ndarray) -> tuple[float, float]:
    """Angle by which ``tilt`` (n,) complex has to be turned to follow ``path``, and their correlation then."""
    product = complex(np.vdot(tilt, path))
    size = float(np.linalg.norm(tilt) * np.linalg.norm(path))
    return math.atan2(product.imag, product.real), abs(product) / size if size > 0.0 else 0.0


@dataclass(frozen=True)
class Mirrored:
    """Columns of the motion capture that make path and attitude mirror images: one to negate, or two that changed
    places. ``follows``: correlation of tilt and acceleration once that is mended."""

    quantities: tuple[str, ...]
    swapped: bool
    follows: float


def mirrored(context: Context) -> Mirrored | None:
    """A path whose accelerations are the mirror image of those of the tilt: no rotation mends that. An axis that is
    negated or two axes that changed places do. The attitude is at fault where the gyro turns against it, too."""
    both = context.once(tilt_and_acceleration)
    if both is None or (mirror := _mirror(both)) is None or mirror[0] == SWAPPED_AND_NEGATED:
        return None
    quarter, follows = mirror
    return Mirrored(MENDED[quarter], quarter == SWAPPED, follows)


SWAPPED, SWAPPED_AND_NEGATED = 1, 3
"""Quarter turns between a path and the mirror image of its tilt. The latter is that of an attitude in NED and FRD."""
MENDED = {0: ("py",), SWAPPED: ("px", "py"), 2: ("px",)}


def _mirror(both: np.ndarray) -> tuple[int, float] | None:
    """Quarter turns by which the mirror image of the tilt follows the path, and their correlation; None where it does
    not, or not clearly better than the tilt."""
    path, tilt = (v[:, 0] + 1j * v[:, 1] for v in both[:2])
    angle, follows = _turn(tilt.conj(), path)
    _, straight = _turn(tilt, path)
    _, inverted = _turn(both[2][:, 0] + 1j * both[2][:, 1], path)
    other = max(straight, inverted)  # a path that is longer than wide looks like its mirror image, turned by 180 deg
    if follows < FOLLOWS or (follows < other + MIRRORED and 1.0 - other < FAR_BETTER * (1.0 - follows)):
        return None
    quarter = round(2.0 * angle / math.pi) % 4
    if abs(math.remainder(angle - quarter * math.pi / 2.0, 2.0 * math.pi)) > 0.5 * TURNED_RAD:
        return None
    return quarter, follows


def other_height(context: Context) -> Axis | None:
    """The axis along which a vehicle rises above the ground on which it rested. None if it is z, or if the vehicle does
    not tilt as one with z up."""
    ground = context.once(ground_axes)
    usual = context.once(tilts)["x, y, z, w"].get((UPWARDS, UPWARDS))
    if len(ground) != 1 or UPWARDS in ground or usual is None or not usual.flies:
        return None
    return next(iter(ground))

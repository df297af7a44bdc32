"""A tracked attitude that a program made from Euler angles of another order or sign.

The vehicle then speeds up to another side than that to which it tilts, and no turn or mirror image of the path mends
that. With the angles in the right order and with their signs it does not.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from ..settings import number
from .context import Context
from .flown_axes import UP, seen_poses, tilts, tilts_of
from .quaternion_reading import CLEARLY, FITS
from .quaternions import quaternion_orders
from .tilt_heading import mirrored, wrong_heading

ORDERS = ("XYZ", "ZYX")
ANGLES = ("roll", "pitch", "yaw")
BETTER = 0.01
"""Of correlation: another change needs more. A turn about z that comes last changes no tilt."""
SHOWN = number("audit.euler_reading.shown")


@dataclass(frozen=True)
class EulerReading:
    """``change``: what to do to the angles; ``follows``: correlation of tilt and acceleration then, ``stored`` as
    read."""

    change: str
    follows: float
    stored: float


def euler_reading(context: Context) -> EulerReading | None:
    """None where the attitude fits in any axes, or with a path that is turned or mirrored. None, too, where no order
    and no sign explains it."""
    as_read = context.once(tilts)["x, y, z, w"]
    usual = as_read.get((UP, UP))
    order = context.once(quaternion_orders).get("mocap")
    if usual is None or usual.follows > FITS or any(t.flies for axes, t in as_read.items() if axes != (UP, UP)):
        return None
    if (order is not None and not order.reading.as_stored) or context.once(wrong_heading) is not None \
            or context.once(mirrored) is not None:
        return None
    time_s, position, quaternion = context.once(seen_poses)
    best = EulerReading("", max(SHOWN, usual.follows + CLEARLY), usual.follows)
    for signs in sorted(product((1.0, -1.0), repeat=3), reverse=True, key=sum):
        for stored, read in product(ORDERS, ORDERS):
            angles = _angles(quaternion, stored)
            turn = Rotation.from_euler(read, (angles * signs)[:, ["XYZ".index(a) for a in read]]).as_quat()
            tilt = tilts_of(time_s, position, turn).get((UP, UP))
            if tilt is not None and tilt.follows > best.follows + BETTER * bool(best.change) and tilt.each > FITS:
                negated = [name for name, sign in zip(ANGLES, signs, strict=True) if sign < 0.0]
                parts = [f"turn about {', '.join(read.lower())} in this order"] * (read != stored)
                parts += [f"negate {' and '.join(negated)}"] * bool(negated)
                best = EulerReading(", and ".join(parts), tilt.follows, usual.follows)
    return best if best.change else None


def _angles(quaternion: np.ndarray, order: str) -> np.ndarray:
    """(n, 3) rad about x, y, z of turns about axes of the body in this order."""
    return np.asarray(Rotation.from_quat(quaternion).as_euler(order)[:, [order.index(a) for a in "XYZ"]])

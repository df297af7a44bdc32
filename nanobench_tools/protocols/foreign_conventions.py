"""Conventions in which a trajectory of another program differs from the truth: axes of its body, order of its
quaternions, unit of its path.

Its score counts them as errors. A sentence names them, so that nobody takes them for errors of the estimator.
"""

from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from ..metrics.alignment import AlignmentError, align
from ..metrics.trajectory import ate
from ..settings import number
from ..signals.quaternion_reading import AS_STORED, SCALAR_FIRST, SCALAR_LAST_READ_FIRST, Reading

OTHER_BODY_RAD = np.radians(number("protocols.foreign_conventions.other_body_deg"))
STEADY_RAD = np.radians(number("protocols.foreign_conventions.steady_deg"))
LEAST_WRONG_RAD = np.radians(number("protocols.foreign_conventions.least_wrong_deg"))
EXPLAINED = number("protocols.foreign_conventions.explained")
OTHER_SCALE = number("protocols.foreign_conventions.other_scale")


def convention_of(position_m: np.ndarray, quaternion: np.ndarray, world: np.ndarray, truth_m: np.ndarray,
                  truth_quaternion: np.ndarray) -> str:
    """What differs, in words; "" where nothing does.

    - position_m, truth_m: (n, 3) m in one world.
    - quaternion: (n, 4) x, y, z, w as written; world: (3, 3), turns it to that world.
    - truth_quaternion: (n, 4), body to that world."""
    return "; ".join(filter(None, (_scale(position_m, truth_m),
                                   _body(quaternion, Rotation.from_matrix(world), truth_quaternion))))


def _scale(position_m: np.ndarray, truth_m: np.ndarray) -> str:
    try:
        aligned = align(position_m, truth_m).apply(position_m)
    except AlignmentError:
        return ""
    path, true = aligned - aligned.mean(axis=0), truth_m - truth_m.mean(axis=0)
    factor = max(float(np.sum(path * true)) / float(np.sum(true * true)), 1e-12)
    if max(factor, 1.0 / factor) < OTHER_SCALE:
        return ""
    left = float(np.sqrt(np.mean(np.sum((path / factor - true) ** 2, axis=1))))
    if left > EXPLAINED * ate(position_m, truth_m).rmse_m:
        return ""
    unit = next((f": it is in {unit}" for unit, size in (("mm", 1000.0), ("cm", 100.0))
                 if abs(factor / size - 1.0) < OTHER_SCALE - 1.0), "")
    return (f"its path is {float(f'{factor:.2g}'):g} times as large as the tracked one{unit}, and is scored as "
            "written")


def _body(quaternion: np.ndarray, world: Rotation, truth_quaternion: np.ndarray) -> str:
    """The reading of the quaternions, or the turn of the body, that leaves least of the error of the attitude."""
    both = np.hstack([quaternion, truth_quaternion])
    known = np.isfinite(both).all(axis=1) & both[:, :4].any(axis=1) & both[:, 4:].any(axis=1)
    if not known.any():
        return ""
    quaternion, truth = quaternion[known], Rotation.from_quat(truth_quaternion[known])
    turns = truth.inv() * world * Rotation.from_quat(quaternion)
    error = float(np.median(turns.magnitude()))
    if error < LEAST_WRONG_RAD:
        return ""
    mount = turns.mean()
    left = float(np.median((mount.inv() * turns).magnitude()))
    found = ""
    if mount.magnitude() > OTHER_BODY_RAD and left < min(STEADY_RAD, EXPLAINED * error):
        found = (f"its body is turned by {np.degrees(mount.magnitude()):.1f} deg against the tracked one, and the "
                 "errors of its attitude include that turn")
    else:
        left = EXPLAINED * error
    for order, inverted in product((AS_STORED, SCALAR_FIRST, SCALAR_LAST_READ_FIRST), (False, True)):
        reading = Reading(order.order, order.places, inverted)
        read = float(np.median((truth.inv() * world * Rotation.from_quat(reading.of(quaternion))).magnitude()))
        if not reading.as_stored and read < left:
            left = read
            found = (f"its quaternions are {reading.meaning}: so read, its attitude is {np.degrees(read):.1f} deg off, "
                     f"and {np.degrees(error):.1f} deg as scored")
    return found

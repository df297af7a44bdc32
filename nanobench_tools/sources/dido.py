"""DIDO (HDF5): inertial sensor, rotor speeds and truth of a quadrotor of 1.1 kg on the same rows.

``gt_q`` is w, x, y, z. ``meas_rpm`` holds the timestamp in its first column and four rotor speeds in 10^4 rpm; which
rotor is which is not documented.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..flight import Flight
from ..units import factor
from .hdf5_file import arrays_of, columns, flight_of, holds, unit_quaternions, why_strange
from .sheets import Sheet

NAMES = ("ts", "acc", "gyr", "gt_p", "gt_v", "gt_q", "gt_gyr", "meas_rpm")
RPM = 1e4 * factor("rpm")
PLAUSIBLE_RAD_S = (100.0, 6000.0)
"""Median rotor speed; without it the unit is another."""


class Dido:
    """Source ``dido``."""

    name = "dido"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        return holds(path, head, ("ts", "gt_q", "meas_rpm"))

    def why_not(self, head: bytes) -> str | None:
        return why_strange(head)

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        place = str(path)
        found = arrays_of(data, place, NAMES)
        stamps = found.get("ts", np.zeros(0))
        n = len(stamps)
        truth = [columns(found, "gt_p", 3, n, place),
                 unit_quaternions(columns(found, "gt_q", 4, n, place)[:, [1, 2, 3, 0]], place)]
        names = ["px", "py", "pz", "qx", "qy", "qz", "qw"]
        for key, more in (("gt_v", ("vx", "vy", "vz")), ("gt_gyr", ("wx", "wy", "wz"))):
            if key in found:
                truth.append(columns(found, key, 3, n, place))
                names += more
        imu = [columns(found, "acc", 3, n, place), columns(found, "gyr", 3, n, place)]
        values = {"mocap": (names, np.hstack(truth)),
                  "imu": (("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z"), np.hstack(imu))}
        notes = []
        speed = RPM * columns(found, "meas_rpm", 5, n, place)[:, 1:]
        if PLAUSIBLE_RAD_S[0] < np.nanmedian(speed) < PLAUSIBLE_RAD_S[1]:
            values["rpm"] = (("m1", "m2", "m3", "m4"), speed)
            notes.append("rpm: m1 to m4 in the order of the file; which rotor is which is not documented")
        else:
            notes.append(f"rpm left out: a median of {np.nanmedian(speed):.3g} rad/s is no rotor speed")
        return flight_of(path, self.name, stamps, values, notes, held=("rpm",))

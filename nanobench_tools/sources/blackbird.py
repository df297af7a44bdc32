"""Blackbird as the HDF5 files of learned_inertial_model_odometry: 100 Hz, world z up, body z down.

Body and attitude are turned together into forward, left, up where the accelerometer shows that z points down.
``thrust`` is the specific thrust that measured rotor speeds give, m/s^2, and no command: it is kept apart.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import so3
from ..errors import InputError
from ..flight import Flight
from ..units import GRAVITY_M_S2
from .axes import frame_of, in_our_axes
from .hdf5_file import arrays_of, columns, flight_of, holds, unit_quaternions
from .sheets import Sheet

NAMES = ("ts", "gyro_raw", "accel_raw", "traj_target", "thrust")
GRAVITY_SHARE = 0.8
"""Share of gravity that the accelerometer turned into the world has along z, on average."""


class Blackbird:
    """Source ``blackbird``."""

    name = "blackbird"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        return holds(path, head, ("ts", "gyro_raw", "accel_raw", "traj_target"))

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        place = str(path)
        found = arrays_of(data, place, NAMES)
        stamps = found.get("ts", np.zeros(0))
        n = len(stamps)
        truth = columns(found, "traj_target", 7, n, place)
        q = unit_quaternions(truth[:, 3:], place)
        acc, gyro = columns(found, "accel_raw", 3, n, place), columns(found, "gyro_raw", 3, n, place)
        known = np.isfinite(q).all(axis=1) & np.isfinite(acc).all(axis=1)
        up = so3.rotate(q[known], acc[known]).mean(axis=0) if known.any() else np.zeros(3)
        if up[2] < GRAVITY_SHARE * GRAVITY_M_S2:
            raise InputError(f"{place}: accel_raw", f"turned into the world it is {up[2]:.3g} m/s^2 along z, where "
                             "gravity belongs: its axes or its unit are others", "read the data with a column map")
        values = {"mocap": (("px", "py", "pz", "qx", "qy", "qz", "qw"), np.hstack([truth[:, :3], q])),
                  "imu": (("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z"), np.hstack([acc, gyro]))}
        if "thrust" in found and found["thrust"].shape == (n, 3):
            values["extra_specific_thrust"] = (("ax", "ay", "az"), found["thrust"])
        notes = ["extra_specific_thrust: m/s^2 in the axes of the file, from rotor speeds; no command"] * (
            "extra_specific_thrust" in values)
        down = float(np.nanmean(acc[:, 2])) < 0.0
        if down:
            notes.append("body axes FRD turned into forward, left, up: gravity lies along -z of the accelerometer")
        flight = flight_of(path, self.name, stamps, values, notes)
        if not down:
            return flight
        frame = frame_of("FRD")
        return flight.with_streams(**{name: in_our_axes(flight[name], frame) for name in ("mocap", "imu")})

"""A source: a first line ``plain log``, then lines of time s, pose m and x y z w, and gyro rad/s, blanks between."""

import numpy as np

from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, Provenance, make_stream

FIRST = b"plain log\n"
COLUMNS = 11


class PlainLog:
    """Two streams, ``mocap`` and ``imu``."""

    name = "plain_log"
    version = 1

    def recognises(self, path, head: bytes) -> bool:
        """From the first bytes alone."""
        return head.startswith(FIRST)

    def read(self, path, data: bytes, sheet=None) -> Flight:
        """Raises InputError for rows of another length."""
        try:
            rows = np.array([line.split() for line in data[len(FIRST):].decode().splitlines()], float)
        except ValueError as error:
            raise InputError(str(path), f"no table of numbers ({error})", f"give {COLUMNS} in every line") from None
        if rows.ndim != 2 or rows.shape[1] != COLUMNS:
            raise InputError(str(path), "rows of another length", f"give {COLUMNS} numbers in every line")
        time_s = rows[:, 0] - rows[0, 0]
        rate = {"rate_hz": (len(rows) - 1) / time_s[-1]}
        return Flight(path.name, {
            "mocap": make_stream("mocap", time_s, rows[:, 1:8], ("px", "py", "pz", "qx", "qy", "qz", "qw"), **rate),
            "imu": make_stream("imu", time_s, rows[:, 8:], ("gyro_x", "gyro_y", "gyro_z"), **rate)},
            {"family": None, "speed": None, "reference_speed_m_s": None}, Provenance(str(path), "", self.name),
            epoch_s=float(rows[0, 0]))

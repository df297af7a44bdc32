"""Filter with an unknown delay of the poses: the offset between the poses' clock and the vehicle's is a state.

A pose is compared with the position of the filter at that time, found by undoing the later integration of the IMU. The
change of this comparison with the offset is the velocity (and, for the attitude, the rate) at that time.
"""

from dataclasses import replace
from typing import ClassVar

from nanobench_tools.flight import Flight
from nanobench_tools.methods import Estimate
from nanobench_tools.settings import number

from .drag_ekf import DragMatrixEkf

OFFSET_SD_S = number("imu.delayed_pose_ekf.offset_sd_s")
"""Before anything is seen."""


class DelayedPoseEkf(DragMatrixEkf):
    """``drag_matrix_ekf`` that estimates how late poses come.

    It ignores ``metadata["pose_delay_s"]``. Late poses and early timestamps of the vehicle look alike: it takes the
    vehicle's timestamps as right.
    """

    name = "delayed_pose_ekf"
    settings: ClassVar = {**DragMatrixEkf.settings, "late_sd": OFFSET_SD_S, "late_moves": 0.0}

    def estimate(self, flight: Flight) -> Estimate:
        """As ``Inertial.estimate``."""
        known = {key: value for key, value in flight.metadata.items() if key != "pose_delay_s"}
        return super().estimate(replace(flight, metadata=known))

"""Dead reckoning with gyro, accelerometer and the pattern of missing packets.

Additions to ``error_state_ekf``: missing packets correct the timestamps, and the rest of their error is a state. The
bias of the vertical accelerometer drifts as the board warms. Drag has a slow flow of the air as a state.

References
----------
Leishman et al. 2014, "Quadrotors and accelerometers: State estimation with an improved dynamic model", IEEE Control
Systems 34(1).
"""

from typing import ClassVar

from nanobench_tools.settings import setting

from .inertial import Inertial

TUNED = setting("estimators.drag_ekf.drag_matrix_ekf")


class DragEkf(Inertial):
    """Dead reckoning on gyro, accelerometer and linear drag, the same along x and y."""

    name = "drag_ekf"
    settings: ClassVar = setting("estimators.drag_ekf.drag_ekf")


class DragMatrixEkf(Inertial):
    """Dead reckoning on gyro, accelerometer and drag with cross terms (2 x 2) and a quadratic part."""

    name = "drag_matrix_ekf"
    settings = TUNED

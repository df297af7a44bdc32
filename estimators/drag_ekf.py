"""Dead reckoning with all that gyro, accelerometer and the pattern of missing packets can say.

Beyond ``error_state_ekf``: stamps are set back by what the missing packets tell, what is left of their error is a
state; the bias of the vertical accelerometer drifts as the board warms; drag carries a slow flow of the air as state.
"""

from __future__ import annotations

from typing import ClassVar

from .inertial import Inertial

TUNED: dict[str, float] = {
    "gyro_noise": 0.03, "acc_noise": 0.0353, "vertical_noise": 0.0157, "gyro_walk": 0.000113, "acc_walk": 0.00326,
    "position_sd": 0.00165, "roll_pitch_sd": 0.0244, "pitch_sd": 0.0681, "yaw_sd": 0.169, "drag": 0.376,
    "drag_quadratic": 0.0352, "drag_sd": 0.217, "air_sd": 0.00978, "air_s": 0.645, "slope_mean": 0.00119,
    "slope_sd": 0.000716, "late_sd": 0.00301, "wander_sd": 0.00297, "wander_s": 0.2, "acc_bias_sd": 0.193,
    "acc_bias_z_sd": 0.353, "mount_sd": 0.382,
}
"""Found by random search for small end errors in blackout on the circles and trefoils of NanoBench; all other families
were held out."""


class DragEkf(Inertial):
    """Linear drag, the same along x and y."""

    name = "drag_ekf"
    settings: ClassVar = {**TUNED, "drag": 0.4, "drag_quadratic": 0.0}


class DragMatrixEkf(Inertial):
    """Drag with cross terms (2 x 2) and a quadratic part."""

    name = "drag_matrix_ekf"
    settings = TUNED

"""``drag_matrix_ekf`` with thrust as vertical aid: motor voltage says the specific force along the rotors' axis.

Thrust over that of the map is a state that walks, since the map is good to some percent only and by flight; thrust
falls as the vehicle climbs (inflow), which is what tells the vertical velocity.
"""

from __future__ import annotations

from .inertial import Inertial

TUNED: dict[str, float] = {
    "gyro_noise": 0.032, "acc_noise": 0.0353, "vertical_noise": 0.025, "gyro_walk": 0.000163, "acc_walk": 0.00326,
    "position_sd": 0.00251, "roll_pitch_sd": 0.0244, "pitch_sd": 0.0506, "yaw_sd": 0.169, "drag": 0.372,
    "drag_cross": 0.00134, "drag_quadratic": 0.0352, "drag_sd": 0.411, "air_sd": 0.00409, "air_s": 1.45,
    "slope_mean": 0.00165, "slope_sd": 0.000624, "late_sd": 0.00301, "wander_sd": 0.00833, "wander_s": 0.21,
    "acc_bias_sd": 0.129, "acc_bias_z_sd": 0.535, "mount_sd": 0.235, "lift_bias_sd": 0.0107, "thrust_sd": 2.03,
    "scale_walk": 0.00244, "scale_sd": 0.0458, "inflow": 0.02,
}
"""As ``drag_ekf.TUNED``."""


class ThrustEkf(Inertial):
    """Needs the streams ``motor`` and ``battery``."""

    name = "thrust_ekf"
    settings = TUNED
    needs = ("motor", "battery")

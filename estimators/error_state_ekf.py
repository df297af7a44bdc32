"""Dead reckoning by an error-state extended Kalman filter on the recorded IMU, with drag as velocity information.

State: position, velocity (world), attitude, and biases of accelerometer and gyro. Also the small constant rotation
from the IMU to the tracked body frame (``inertial_core``). A quadrotor's accelerometer measures no thrust across its
rotor axis, only drag. Its x and y are therefore -k v.

References
----------
Leishman et al. 2014, "Quadrotors and accelerometers: State estimation with an improved dynamic model", IEEE Control
Systems 34(1).
"""

from typing import ClassVar

from nanobench_tools.settings import setting

from .inertial import Inertial


class ErrorStateEkf(Inertial):
    """Error-state filter of poses, gyro and accelerometer; without poses, position follows from IMU and drag alone."""

    name = "error_state_ekf"
    settings: ClassVar = setting("estimators.error_state_ekf.error_state_ekf")
    radio = False


class Strapdown(Inertial):
    """Error-state filter without drag: after the last pose, plain integration of the IMU."""

    name = "strapdown"
    settings: ClassVar = setting("estimators.error_state_ekf.strapdown")
    radio = False

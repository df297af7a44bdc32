"""Dead reckoning by an error-state extended Kalman filter on the recorded IMU, with drag as velocity information.

State: position, velocity (world), attitude, biases of accelerometer and gyro, and the small constant rotation from the
IMU to the tracked body frame (``inertial_core``). A quadrotor's accelerometer feels no thrust across its rotor axis,
only drag, so its x and y say -k v (Leishman et al., "Quadrotors and accelerometers", IEEE Control Systems 2014).
"""

from __future__ import annotations

from typing import ClassVar

from .inertial import Inertial

SETTINGS = {"gyro_noise": 0.00236, "acc_noise": 0.011, "vertical_noise": 0.00374, "stamp": 0.0095,
            "gyro_walk": 5.5e-05, "acc_walk": 0.00132, "acc_bias_sd": 0.1, "position_sd": 0.004, "roll_pitch_sd": 0.009,
            "pitch_sd": 0.0262, "yaw_sd": 0.179, "drag": 0.4, "drag_sd": 0.3}
"""Noise as in ``drag_ekf``: the sensors' own is small, stamps that wander make it grow with how fast signals change.
The attitude of a pose counts little, because tilt and gravity agree in it to half a degree only; drag is that of a 40 g
Crazyflie over its mass."""


class ErrorStateEkf(Inertial):
    """Poses are used while they come; afterwards position follows from gyro, accelerometer and drag alone."""

    name = "error_state_ekf"
    settings = SETTINGS
    radio = False
    drag_1_s = SETTINGS["drag"]


class Strapdown(Inertial):
    """The same filter without drag: after the last pose, plain integration of the IMU."""

    name = "strapdown"
    settings: ClassVar = {**SETTINGS, "drag": 0.0}
    radio = False

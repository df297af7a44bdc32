"""What recordings of each source usually hold, in streams and quantities, and how the verbs can use them."""

from __future__ import annotations

from collections.abc import Mapping

IMU = ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")
POSITION, ROTATION, VELOCITY = ("px", "py", "pz"), ("qx", "qy", "qz", "qw"), ("vx", "vy", "vz")
MOTORS, ESTIMATE = ("m1", "m2", "m3", "m4"), ("x", "y", "z", "vx", "vy", "vz")
ACCELERATION = ("ax", "ay", "az")
Contents = Mapping[str, tuple[str, ...]]

CONTENTS: dict[str, Contents] = {
    "nanobench": {"mocap": (*POSITION, *ROTATION, *VELOCITY), "imu": IMU, "motor": MOTORS, "estimator": ESTIMATE,
                  "estimator_acc": ACCELERATION, "attitude": ("roll", "pitch", "yaw"), "attitude_qw": ROTATION,
                  "setpoint": ("x", "y", "z", "yaw"), "battery": ("vbat",)},
    "usd": {"imu": IMU, "motor": MOTORS, "rpm": MOTORS, "battery": ("vbat",), "estimator": ESTIMATE,
            "attitude_qw": ROTATION},
    "cfclient": {"imu": IMU, "battery": ("vbat",), "estimator": ESTIMATE},
    "usd_blocks": {"imu": ("gyro_x", "gyro_y", "gyro_z"), "motor": MOTORS, "battery": ("vbat",), "estimator": ESTIMATE,
                   "estimator_acc": ACCELERATION, "attitude_qw": ROTATION},
    "ulog": {"imu": IMU, "motor": MOTORS, "battery": ("vbat",), "estimator": ESTIMATE, "attitude_qw": ROTATION,
             "setpoint": ("x", "y", "z")},
    "ardupilot": {"imu": IMU, "motor": MOTORS, "rpm": MOTORS, "battery": ("vbat",), "estimator": ESTIMATE,
                  "attitude": ("roll", "pitch", "yaw")},
    "blackbox": {"imu": IMU, "motor": MOTORS, "battery": ("vbat",)},
    "rosbag": {"mocap": (*POSITION, *ROTATION), "imu": IMU, "estimator": ESTIMATE, "attitude_qw": ROTATION,
               "battery": ("vbat",)},
    "euroc": {"mocap": (*POSITION, *ROTATION, *VELOCITY), "imu": IMU},
    "uzhfpv": {"mocap": (*POSITION, *ROTATION), "imu": IMU},
    "insane": {"mocap": (*POSITION, *ROTATION), "imu": IMU},
    "idsia": {"mocap": POSITION, "imu": ("gyro_x", "gyro_y", "gyro_z"), "motor": MOTORS, "rpm": MOTORS,
              "command": ("thrust",), "battery": ("vbat",), "estimator": ESTIMATE, "estimator_acc": ACCELERATION,
              "attitude_qw": ROTATION, "setpoint": ("x", "y", "z")},
    "dido": {"mocap": (*POSITION, *ROTATION, *VELOCITY, "wx", "wy", "wz"), "imu": IMU, "rpm": MOTORS},
    "blackbird": {"mocap": (*POSITION, *ROTATION), "imu": IMU},
    "neurobem": {"mocap": (*POSITION, *ROTATION, *VELOCITY, "wx", "wy", "wz"), "rpm": MOTORS, "battery": ("vbat",)},
    "neural_fly": {"estimator": ESTIMATE, "attitude_qw": ROTATION, "imu": ("gyro_x", "gyro_y", "gyro_z"),
                   "setpoint": ("x", "y", "z"), "command": ("thrust",)},
    "tum": {"mocap": (*POSITION, *ROTATION)},
    "kitti": {"mocap": (*POSITION, *ROTATION)},
    "mocap_export": {"mocap": (*POSITION, *ROTATION)},
    "npy_mocap": {"mocap": POSITION},
    "stand": {"stand": ("thrust",), "motor": MOTORS, "battery": ("vbat",)},
}
"""Source -> the usual streams of its recordings. Logs contain what their configuration named: ``usd`` and ``ulog`` may
have motion capture, ``rosbag`` motors with a column map."""

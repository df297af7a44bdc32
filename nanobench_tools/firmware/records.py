"""What goes into and comes out of the firmware's controllers, as packed float32 records (stabilizer_types.h).

Angles are degrees with the firmware's legacy pitch (nose up positive). Rates are deg/s in body axes (FLU, not turned),
quaternions x, y, z, w body to world. Commands are counts of 65535.
"""

from typing import Any

import numpy as np

Record = Any
"""One element of an array of a structured dtype: its fields are attributes in compiled code alone."""
DISABLED, ABSOLUTE, VELOCITY = 0, 1, 2
"""Modes of a setpoint's axis."""

SETPOINT = np.dtype([("mode_x", "i1"), ("mode_y", "i1"), ("mode_z", "i1"), ("mode_roll", "i1"), ("mode_pitch", "i1"),
                     ("mode_yaw", "i1"), ("mode_quat", "i1"), ("velocity_body", "i1"), ("attitude_deg", "f4", 3),
                     ("rate_deg_s", "f4", 3), ("quaternion", "f4", 4), ("thrust", "f4"), ("position_m", "f4", 3),
                     ("velocity_m_s", "f4", 3), ("acceleration_m_s2", "f4", 3), ("jerk_m_s3", "f4", 3)], align=True)
"""Commanded state, in world axes. In ``velocity_body``, x and y of the velocity turn with the yaw."""

ESTIMATE = np.dtype([("position_m", "f4", 3), ("velocity_m_s", "f4", 3), ("attitude_deg", "f4", 3),
                     ("quaternion", "f4", 4), ("gyro_deg_s", "f4", 3)], align=True)
"""What the vehicle believes and measures."""

CONTROL = np.dtype([("thrust", "f4"), ("roll", "i2"), ("pitch", "i2"), ("yaw", "i2")], align=True)
"""What the legacy mixer takes: counts, roll, pitch and yaw in the firmware's signs."""

WRENCH = np.dtype([("thrust_N", "f4"), ("torque_N_m", "f4", 3)], align=True)
"""What the force-torque mixer takes: body FLU."""

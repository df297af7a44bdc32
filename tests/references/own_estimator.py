"""An estimator of one's own: between the poses that are given, straight on with the last velocity and the gyro.

    nanobench estimate --protocol clean --method own_estimator:GyroAndLine
"""

import numpy as np

from nanobench_tools import Estimate, so3


class GyroAndLine:
    name = "gyro_and_line"
    causal = True  # the value at t uses nothing later than t

    def estimate(self, flight):
        imu, mocap = flight["imu"], flight["mocap"]  # mocap holds only the poses that are given
        position, quaternion = mocap["px", "py", "pz"], mocap["qx", "qy", "qz", "qw"]
        velocity = np.zeros_like(position)
        velocity[1:] = np.diff(position, axis=0) / np.diff(mocap.time_s)[:, None]  # causal: from the pose before

        time_s = imu.time_s[imu.time_s >= mocap.time_s[0]]
        last = np.searchsorted(mocap.time_s, time_s, side="right") - 1  # the newest pose not later than t
        age = (time_s - mocap.time_s[last])[:, None]
        rate = imu["gyro_x", "gyro_y", "gyro_z"][-len(time_s):]
        return Estimate(time_s, position[last] + velocity[last] * age,
                        so3.multiply(quaternion[last], so3.exp(rate * age)), velocity[last])

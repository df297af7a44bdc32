"""An estimator: the last two poses given, and on along the line through them."""

import numpy as np

from nanobench_tools.methods import Estimate


class WalksOn:
    """At the stamps of the gyro; causal."""

    name = "walks_on"
    causal = True

    def estimate(self, flight) -> Estimate:
        """Of a Flight."""
        mocap, time_s = flight["mocap"], flight["imu"].time_s
        position = mocap["px", "py", "pz"]
        last = np.clip(np.searchsorted(mocap.time_s, time_s, side="right") - 1, 1, None)
        velocity = (position[last] - position[last - 1]) / np.diff(mocap.time_s)[last - 1, None]
        age = np.clip(time_s - mocap.time_s[last], 0.0, 0.1)[:, None]
        return Estimate(time_s, position[last] + age * velocity, mocap["qx", "qy", "qz", "qw"][last], velocity)

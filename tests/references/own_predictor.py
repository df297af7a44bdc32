"""A predictor of one's own: each window goes straight on and turns with the rate it started with.

    nanobench sysid --method own_predictor:StraightOn
"""

import numpy as np

from nanobench_tools import Prediction, so3


class StraightOn:
    name = "straight_on"
    information = "state"  # start state and inputs only; "past" would also see the streams before the start

    def predict(self, windows):
        steps = np.arange(1, windows.horizon + 1) / windows.rate_hz  # s after the start, (H,)
        ahead = steps[None, :, None]
        turned = so3.multiply(windows.quaternion[:, None], so3.exp(windows.rate_rad_s[:, None] * ahead))
        return Prediction(
            position_m=windows.position_m[:, None] + windows.velocity_m_s[:, None] * ahead,
            velocity_m_s=np.repeat(windows.velocity_m_s[:, None], windows.horizon, axis=1),
            quaternion=turned,
            rate_rad_s=np.repeat(windows.rate_rad_s[:, None], windows.horizon, axis=1))

"""The model without dynamics: the state does not change."""

import numpy as np

from nanobench_tools.methods import Prediction, Windows


class Naive:
    """Position, velocity, attitude and rate stay what they were at the start (Busetto et al. 2025, "naive")."""

    name = "naive"
    information = "state"

    def predict(self, windows: Windows) -> Prediction:
        def held(state: np.ndarray) -> np.ndarray:
            return np.repeat(state[:, None], windows.horizon, axis=1)

        return Prediction(held(windows.position_m), held(windows.velocity_m_s), held(windows.quaternion),
                          held(windows.rate_rad_s))

"""The estimator that knows nothing: the last pose given, for ever."""

import numpy as np

from nanobench_tools.flight import Flight
from nanobench_tools.methods import Estimate

from .report_times import densest_stamps


class HoldPosition:
    """Holds the last motion capture pose it was given; the floor that any estimator has to beat."""

    name = "hold_position"
    causal = True

    def estimate(self, flight: Flight) -> Estimate:
        mocap = flight["mocap"]
        time_s = densest_stamps(flight)
        last = np.clip(np.searchsorted(mocap.time_s, time_s, side="right") - 1, 0, None)
        return Estimate(time_s, mocap["px", "py", "pz"][last], mocap["qx", "qy", "qz", "qw"][last],
                        np.zeros((len(time_s), 3)))

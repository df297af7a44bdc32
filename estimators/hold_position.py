"""Estimator that keeps the last pose that was given."""

import numpy as np

from nanobench_tools.flight import Flight
from nanobench_tools.methods import Estimate

from .report_times import densest_stamps


class HoldPosition:
    """Keep the last pose of the motion capture: the floor that any estimator has to beat. It uses poses only."""

    name = "hold_position"
    causal = True

    def estimate(self, flight: Flight) -> Estimate:
        """Estimate the trajectory of one flight.

        Parameters
        ----------
        flight : Flight
            Uses ``mocap``: position [m] and quaternion, world.

        Returns
        -------
        Estimate
            At the densest timestamps of the flight, with zero velocity.

        Raises
        ------
        InputError
            Without motion capture.
        """
        mocap = flight["mocap"]
        time_s = densest_stamps(flight)
        last = np.clip(np.searchsorted(mocap.time_s, time_s, side="right") - 1, 0, None)
        return Estimate(time_s, mocap["px", "py", "pz"][last], mocap["qx", "qy", "qz", "qw"][last],
                        np.zeros((len(time_s), 3)))

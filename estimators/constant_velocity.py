"""Estimator that continues in a straight line from the last poses that were given."""

import numpy as np

from nanobench_tools.flight import Flight
from nanobench_tools.methods import Estimate
from nanobench_tools.settings import number

from .report_times import densest_stamps

SLOPE_S = number("imu.constant_velocity.slope_s")


class ConstantVelocity:
    """Keep the velocity and the attitude of the last poses. It uses poses only."""

    name = "constant_velocity"
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
            At the densest timestamps of the flight, with velocity.

        Raises
        ------
        InputError
            Without motion capture.
        """
        mocap = flight["mocap"]
        time_s = densest_stamps(flight)
        given, position = mocap.time_s, mocap["px", "py", "pz"]
        last = np.clip(np.searchsorted(given, time_s, side="right") - 1, 0, None)
        first = np.minimum(np.searchsorted(given, given[last] - SLOPE_S), last)
        span = given[last] - given[first]
        velocity = (position[last] - position[first]) / np.where(span > 0.0, span, np.inf)[:, None]
        ahead = np.maximum(time_s - given[last], 0.0)
        return Estimate(time_s, position[last] + velocity * ahead[:, None],
                        mocap["qx", "qy", "qz", "qw"][last], velocity)

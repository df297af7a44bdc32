"""The estimate of the vehicle's own extended Kalman filter, as it was logged over the radio."""

import numpy as np

from .. import so3
from ..flight import Flight
from ..methods import Estimate


class OnboardEkf:
    """The logged estimate: position and velocity of ``estimator``, attitude of ``attitude_qw`` (else ``attitude``).

    The vehicle received motion capture poses over radio. So this row does not compete with methods without poses.
    """

    name = "onboard_ekf"
    causal = True

    def estimate(self, flight: Flight) -> Estimate:
        """Estimate the trajectory of one flight.

        Parameters
        ----------
        flight : Flight
            Uses ``estimator`` and ``attitude_qw`` or ``attitude``, world.

        Returns
        -------
        Estimate
            At the timestamps of ``estimator``; attitudes are interpolated onto them.

        Raises
        ------
        InputError
            Without an ``estimator`` or an attitude stream.
        """
        stream = flight["estimator"]
        if "attitude_qw" in flight:
            logged = flight["attitude_qw"]
            quaternion = logged["qx", "qy", "qz", "qw"]
        else:
            logged = flight["attitude"]
            quaternion = so3.from_euler_zyx(*logged["roll", "pitch", "yaw"].T)
        if not np.array_equal(logged.time_s, stream.time_s):
            quaternion = so3.interpolate(logged.time_s, quaternion, stream.time_s)
        velocity = stream["vx", "vy", "vz"] if "vx" in stream else None
        return Estimate(stream.time_s, stream["x", "y", "z"], quaternion, velocity)

    def logged_euler(self, flight: Flight) -> np.ndarray:
        """(n, 3) rad: roll, pitch, yaw of the ``attitude`` stream at the estimator's timestamps, neither wrapped nor
        normalised. Past the end of a log they run on as straight lines, which the published table counts."""
        stream = flight["attitude"]
        return stream.interpolate(("roll", "pitch", "yaw"), flight["estimator"].time_s)

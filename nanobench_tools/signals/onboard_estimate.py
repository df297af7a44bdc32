"""What the vehicle's own extended Kalman filter said in flight, as logged over the radio."""

import numpy as np

from .. import so3
from ..flight import Flight
from ..methods import Estimate


class OnboardEkf:
    """Position and velocity of the ``estimator`` stream, attitude of ``attitude_qw`` (else ``attitude``) at its stamps.

    It was given the motion capture poses over radio, so it is no rival of a method that has to do without.
    """

    name = "onboard_ekf"
    causal = True

    def estimate(self, flight: Flight) -> Estimate:
        """InputError if the flight has no ``estimator`` or no attitude stream."""
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

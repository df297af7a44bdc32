"""The vehicle's own PID cascade, which flew most of the recordings.

The equations are in ``nanobench_tools.firmware``, where the practice flights use them too.
"""

from nanobench_tools.firmware.onboard import PidCascade


class OnboardPid(PidCascade):
    """The vehicle's own PID cascade: position setpoints in, motor PWM out, at 500 Hz.

    It reads state and gyro, and no derivative of the reference.

    Parameters
    ----------
    parameters : ndarray, optional
        The firmware's gains; default: as released.
    """

    name = "onboard_pid"

"""The vehicle's own PID cascade as a controller row: what flew most of the recordings.

The equations are in ``nanobench_tools.firmware``, where the practice flights use them too.
"""

from nanobench_tools.firmware.onboard import PidCascade


class OnboardPid(PidCascade):
    """The vehicle's own PID cascade: position setpoints in, motor PWM out, at 500 Hz; reads state and gyro, knows
    no derivative of the reference."""

    name = "onboard_pid"

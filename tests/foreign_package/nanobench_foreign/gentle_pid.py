"""A controller: the onboard cascade, led to each setpoint from a little before it."""

from dataclasses import replace

from nanobench_tools.firmware import pid
from nanobench_tools.firmware.onboard import PidCascade


class GentlePid(PidCascade):
    """Asks for 0.98 of the way from where it is."""

    name = "gentle_pid"
    information = "as flown"

    def __init__(self) -> None:
        super().__init__(pid.defaults())

    def command(self, time_s, state, reference):
        """PWM ratios (n, 4)."""
        wanted = state.position_m + 0.98 * (reference.position_m - state.position_m)
        return super().command(time_s, state, replace(reference, position_m=wanted))

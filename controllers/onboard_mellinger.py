"""The vehicle's own Mellinger controller as rows: as it flew, and told all derivatives of the reference.

The equations are in ``nanobench_tools.firmware``, where the practice flights use them too.
"""

from __future__ import annotations

from nanobench_tools.firmware.onboard import Mellinger


class OnboardMellinger(Mellinger):
    """Position setpoints in, motor PWM out, at 500 Hz. As released it believes in 0.029 kg and hangs low."""

    name = "onboard_mellinger"


class MellingerFull(Mellinger):
    """The same gains with velocity, acceleration, yaw rate and the body rates that the jerk asks for."""

    name = "mellinger_full"
    information = "preview"

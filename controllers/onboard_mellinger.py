"""The vehicle's own Mellinger controller: as it flew, and with all derivatives of the reference.

The equations are in ``nanobench_tools.firmware``, where the practice flights use them too.

References
----------
Mellinger, Kumar 2011, "Minimum snap trajectory generation and control for quadrotors", ICRA,
doi:10.1109/ICRA.2011.5980409.
"""

from collections.abc import Mapping

from nanobench_tools.firmware import mellinger
from nanobench_tools.firmware.onboard import Mellinger

from .gains import Gain, around, whole

TUNABLE = {"mass": Gain(0.029, 0.025, 0.05, "kg"), "kp_xy": around(0.4, "N/m"), "kd_xy": around(0.2, "N s/m"),
           "ki_xy": around(0.05, "N/(m s)", 5.0), "kp_z": around(1.25, "N/m"), "kd_z": around(0.4, "N s/m"),
           "ki_z": around(0.05, "N/(m s)", 5.0), "kR_xy": around(70000.0, "1"), "kw_xy": around(20000.0, "s")}
"""By the firmware's names of its parameters."""


class OnboardMellinger(Mellinger):
    """The vehicle's own Mellinger controller: position setpoints in, motor PWM out, at 500 Hz.

    As released it assumes 0.029 kg, so a heavier vehicle hangs low.

    Parameters
    ----------
    parameters : ndarray, optional
        The firmware's gains; default: as released.
    """

    name = "onboard_mellinger"


class MellingerFull(Mellinger):
    """The vehicle's Mellinger controller with velocity, acceleration, yaw rate and the rates that follow from the jerk.

    Parameters
    ----------
    gains : mapping, optional
        Values of the gains below, by name.
    """

    name = "mellinger_full"
    information = "preview"
    tunable: Mapping[str, Gain] = TUNABLE

    def __init__(self, gains: Mapping[str, float] | None = None) -> None:
        found = mellinger.defaults()
        for name, value in whole(TUNABLE, gains, self.name).items():
            found[name] = value
        super().__init__(found)

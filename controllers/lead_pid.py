"""The vehicle's own PID cascade with setpoints that are sent earlier, by its known delay."""

from collections.abc import Mapping

from nanobench_tools.firmware import pid
from nanobench_tools.firmware.onboard import PidCascade
from nanobench_tools.settings import number

from .gains import Gain, around, whole

LEAD_S = number("control.lead_pid.lead_s")


TUNABLE = {"lead_s": Gain(LEAD_S, 0.2, 1.0, "s"), "position": around(2.0, "1/s", 2.5),
           "velocity": around(25.0, "deg s/m", 2.5), "velocity_integral": around(1.0, "deg/m", 5.0),
           "attitude": around(6.0, "1/s", 2.5)}
X, Y, VX, VY, ROLL, PITCH = 0, 1, 3, 4, 6, 7
"""Loops of the cascade; the first two numbers of each are its proportional and integral gain."""


class LeadPid(PidCascade):
    """The onboard PID with position setpoints of ``lead_s`` later: the sender shifts the path.

    This costs nothing and needs no model, so a controller with a model has to beat it.

    Parameters
    ----------
    gains : mapping, optional
        Values of the gains below, by name.
    """

    name = "lead_pid"
    information = "lead"
    tunable: Mapping[str, Gain] = TUNABLE

    def __init__(self, gains: Mapping[str, float] | None = None) -> None:
        k, found = whole(TUNABLE, gains, self.name), pid.defaults()
        self.lead_s = k["lead_s"]
        if gains:
            found["block"][:, [X, Y], 0] = k["position"]
            found["block"][:, [VX, VY], 0], found["block"][:, [VX, VY], 1] = k["velocity"], k["velocity_integral"]
            found["block"][:, [ROLL, PITCH], 0] = k["attitude"]
        super().__init__(found)

"""The vehicle's own PID cascade, told every setpoint earlier by the delay it is known to have."""

from __future__ import annotations

from nanobench_tools.firmware.onboard import PidCascade

LEAD_S = 0.53
"""Median lag of PID behind its setpoints over the 14 training flights it flew (recordings, Task 2)."""


class LeadPid(PidCascade):
    """Position setpoints in, as flown, but those of ``lead_s`` later: whoever streams them shifts the path. What costs
    nothing and needs no model; anything with a model has to beat it."""

    name = "lead_pid"
    information = "lead"
    lead_s = LEAD_S

"""Which onboard controller flew."""

import numpy as np

from .context import Context

ONBOARD = ("pid", "mellinger")
RESERVED = (*ONBOARD, "none", "unknown")
"""Words that a sheet cannot claim: they say what the content shows."""


def controller_of(context: Context) -> str:
    """Content decides between the onboard controllers; any other has the name that its sheet gives (``controller``).

    ``mellinger`` when the PID's roll, pitch and thrust stay exactly 0 and its yaw constant. ``none`` when the motors
    never ran, else ``pid``; ``unknown`` without the streams needed."""
    flight = context.flight
    if "motor" in flight and len(flight["motor"]) and not np.any(np.nan_to_num(flight["motor"].values) > 0.0):
        return "none"
    named = flight.metadata.get("controller")
    if isinstance(named, str) and named.strip() and named not in RESERVED:
        return named
    if "pid" not in flight or not {"roll", "pitch", "yaw", "cmd_thrust"} <= set(flight["pid"].quantities):
        return "unknown"
    pid = flight["pid"]
    if not len(pid) or not np.isfinite(pid.values).any():
        return "unknown"
    quiet = not np.any(np.nan_to_num(pid["roll", "pitch", "cmd_thrust"]))
    return "mellinger" if quiet and np.ptp(np.nan_to_num(pid["yaw"])) == 0.0 else "pid"

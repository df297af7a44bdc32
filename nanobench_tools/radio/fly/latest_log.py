"""What the vehicle last said of itself in its log, and how long ago: a flight must not go by what is old."""

import numpy as np

from ..vehicle_link import Link
from .pose_tracker import Believed

HEALTH = ("pm.vbat", "supervisor.info")
ESTIMATE = ("stateEstimate.x", "stateEstimate.y", "stateEstimate.z")
FRESH_S = 0.2
"""An older estimate, or pose, is not compared: the vehicle moves meanwhile."""


def health_age_s(link: Link, host_s: float) -> float:
    """Since battery or supervisor were last heard of, whichever is longer; inf if never."""
    return host_s - min(link.logged_s.get(name, -np.inf) for name in HEALTH)


def astray(link: Link, believed: Believed | None, host_s: float) -> np.ndarray:
    """From where the poses are to where the vehicle believes to be (3,) m; nan if either is not fresh."""
    if believed is None or host_s - believed.pose_s > FRESH_S:
        return np.full(3, np.nan)
    if not all(host_s - link.logged_s.get(name, -np.inf) < FRESH_S for name in ESTIMATE):
        return np.full(3, np.nan)
    return np.asarray(np.array([link.values[name] for name in ESTIMATE]) - believed.position_m)

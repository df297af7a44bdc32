"""``drag_matrix_ekf`` with thrust as vertical aid: motor voltage says the specific force along the rotors' axis.

Thrust over that of the map is a state that walks, since the map is good to some percent only and by flight; thrust
falls as the vehicle climbs (inflow), which is what tells the vertical velocity.
"""

from __future__ import annotations

from .drag_ekf import TUNED as DRAG
from .inertial import Inertial

TUNED: dict[str, float] = {**DRAG, "drag_cross": 0.00134, "thrust_sd": 3.73, "scale_walk": 0.00496, "scale_sd": 0.0458,
                           "inflow": 0.02}
"""As ``drag_ekf.TUNED``; inflow, which level flights do not show, as before."""


class ThrustEkf(Inertial):
    """Needs the streams ``motor`` and ``battery``."""

    name = "thrust_ekf"
    settings = TUNED
    needs = ("motor", "battery")

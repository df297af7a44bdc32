"""crash: the vehicle fell, tumbled or lay on its side.

Found in the motion capture (else the estimate): the body z axis more than 60 deg from vertical for 0.1 s (the largest
tilt in controlled flight of 79 real ones is 38 deg), or a free fall from the air (downwards faster than 3 m/s; the
hardest real landings hit at 2.1). The span runs from the moment the motors stop or the fall begins, at the earliest
one second before, to the end of the recording: what is measured after a crash is of another vehicle.

Size: the larger of tilt in rad. Smallest found: 60 deg, or 3 m/s.
"""

from __future__ import annotations

import numpy as np

from ..content.airborne import airborne_spans
from ..content.context import Context
from ..content.quaternions import orientation_of
from ..content.rows import runs, usable_streams
from ..content.truth import truth_of
from ..flight import Fault, Flight

KIND = "crash"

TILT_RAD = np.radians(60.0)
LASTS_S = 0.1
FALL_M_S = 3.0
LOOK_BACK_S = 1.0


def find(flight: Flight, context: Context) -> list[Fault]:
    """At most one fault."""
    air = context.once(airborne_spans)
    oriented = context.once(orientation_of)
    if not air or oriented is None:
        return []
    time_s, quaternion = oriented
    up = 1.0 - 2.0 * (quaternion[:, 0] ** 2 + quaternion[:, 1] ** 2)
    tilt = np.arccos(np.clip(up, -1.0, 1.0))
    began = [(float(time_s[a]), f"tilted by up to {np.degrees(tilt[a:b].max()):.0f} deg from {time_s[a]:.2f} s on")
             for a, b in runs(tilt > TILT_RAD) if time_s[b - 1] - time_s[a] >= LASTS_S and time_s[a] >= air[0].start_s]
    truth = context.once(truth_of)
    if truth is not None:
        down = -truth.velocity_m_s[:, 2]
        falls = [a for a, b in runs((down > FALL_M_S) & truth.good) if b - a >= 3]
        began += [(float(truth.time_s[a]), f"falls at {down[a:a + 50].max():.1f} m/s") for a in falls]
    if not began:
        return []
    first, evidence = min(began)
    inside = (time_s >= first) & (time_s >= air[0].start_s)
    return [Fault(KIND, "", (), _began(context, first), flight.span.end_s, float(tilt[inside].max()), "rad", evidence,
                  float(TILT_RAD))]


def _began(context: Context, first_s: float) -> float:
    """When the motors stopped, if within LOOK_BACK_S before ``first_s``; else a tenth of a second before it."""
    motor = context.once(usable_streams).get("motor")
    if motor is not None:
        off = runs(~(np.nan_to_num(motor.values) > 0.0).any(axis=1))
        starts = [float(motor.time_s[a]) for a, _ in off if first_s - LOOK_BACK_S <= motor.time_s[a] <= first_s + 0.1]
        if starts:
            return starts[0]
    return first_s - LASTS_S

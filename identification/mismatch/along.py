"""Prediction of the path alone: a model's acceleration, integrated along the attitude that was measured.

For recordings that show how a vehicle was pushed but not how it was turned. The measured attitude is used over the
whole horizon, for the simulator and the corrected one alike. Only position and velocity are predicted.
"""

from __future__ import annotations

import numpy as np

from nanobench_tools import so3
from nanobench_tools.physics import Model
from nanobench_tools.physics.inputs import rows, warmed
from nanobench_tools.physics.numeric import equations

from .track import ROW_S, Track


def paths(model: Model, track: Track, starts: np.ndarray, horizon: int, warm: int) -> np.ndarray:
    """(starts, horizon + 1, 13) states: position and velocity by Heun's method from the measured ones, attitude and
    rate as measured. ``warm``: rows before a start on which the rotors are warmed up."""
    ahead, behind = starts[:, None] + np.arange(horizon), starts[:, None] + np.arange(-warm, 0)
    window, past = rows(model, track.motor[ahead], track.battery_V[ahead],
                        (track.motor[behind], track.battery_V[behind]), row_hz=1.0 / ROW_S)
    made = equations(model, ROW_S)
    thrust = list(warmed(model, window, past, row_hz=1.0 / ROW_S))
    every = starts[:, None] + np.arange(horizon + 1)
    found = np.concatenate([track.position_m[every], track.velocity_m_s[every],
                            so3.make_continuous(track.quaternion)[every], track.rate_rad_s[every]], axis=2)
    for k in range(horizon):
        now = list(found[:, k].T)
        row = list(window[k])
        if made.tau_s is None:
            begin = end = made.command(row)
        else:
            begin, end = thrust, made.lagged(thrust, row)
        position, velocity = found[:, k, 0:3], found[:, k, 3:6]
        first = np.stack([np.broadcast_to(a, len(starts)) for a in made.body(now, begin)[3:6]], axis=1)
        found[:, k + 1, 0:3] = position + ROW_S * velocity
        found[:, k + 1, 3:6] = velocity + ROW_S * first
        then = made.body(list(found[:, k + 1].T), end)[3:6]
        mean = 0.5 * (first + np.stack([np.broadcast_to(a, len(starts)) for a in then], axis=1))
        found[:, k + 1, 0:3] = position + ROW_S * velocity + 0.5 * ROW_S**2 * mean
        found[:, k + 1, 3:6] = velocity + ROW_S * mean
        thrust = end
    return found

"""Velocity of a motion capture that logs positions alone."""

from dataclasses import replace

import numpy as np

from ..flight import Flight

HALF_STEP_S = 0.01
"""Half the base of a difference: 20 ms, as ``mocap_derivatives``. Chosen: one frame of 100 Hz on either side."""
VELOCITY = ("vx", "vy", "vz")


def has_velocity(flight: Flight) -> bool:
    """Whether the motion capture has vx, vy and vz."""
    return all(name in flight["mocap"] for name in VELOCITY)


def with_velocity(flight: Flight) -> Flight:
    """The flight with columns vx, vy, vz of ``mocap``, derived from px, py, pz; the flight itself where it has them.

    Timestamps have to rise. See ``velocity_of``.
    """
    mocap = flight["mocap"]
    if has_velocity(flight):
        return flight
    kept = [k for k, name in enumerate(mocap.quantities) if name not in VELOCITY]
    values = np.column_stack([mocap.values[:, kept], velocity_of(mocap.time_s, mocap["px", "py", "pz"])])
    columns, quantities, units = (tuple(names[k] for k in kept) for names in (mocap.columns, mocap.quantities,
                                                                             mocap.unit))
    return flight.with_streams(mocap=replace(mocap, values=values, columns=(*columns, *VELOCITY),
                                             quantities=(*quantities, *VELOCITY), unit=(*units, *["m/s"] * 3)))


def velocity_of(time_s: np.ndarray, position_m: np.ndarray) -> np.ndarray:
    """Central differences over 2 * HALF_STEP_S of the line through the positions: (n, 3) m/s, in the same world.

    time_s (n,) s, rising, n >= 2; position_m (n, 3) m. Where rows are further apart than HALF_STEP_S, this is the mean
    of the slopes on both sides. The first and the last row have one side only.
    """
    early, late = np.maximum(time_s - HALF_STEP_S, time_s[0]), np.minimum(time_s + HALF_STEP_S, time_s[-1])
    moved = [np.interp(late, time_s, column) - np.interp(early, time_s, column) for column in position_m.T]
    return np.asarray(np.stack(moved, axis=1) / (late - early)[:, None])

"""What Task 1 needs and recordings may lack: velocity and attitude from poses, and an assumed battery voltage."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import savgol_filter

from ..auditing.usable import POSE
from ..flight import Flight, Stream
from ..settings import number
from .backward import CENTRED_ROWS

ASSUMED_V = number("tasks.completed.assumed_v")
ROWS, ORDER, STEP_S = 2 * CENTRED_ROWS + 1, 3, 0.01
"""Of the filter that gives the published velocities."""
POSITION, TURN, VELOCITY = ("px", "py", "pz"), ("qx", "qy", "qz", "qw"), ("vx", "vy", "vz")


def completed(flights: Sequence[Flight]) -> list[Flight]:
    """Flights with velocity and attitude from their poses and, where no flight has a battery voltage, a constant one.

    Provenance ``added`` lists what was added. A flight without battery among others that have one stays as it is: one
    level of thrust for both would be wrong.
    """
    constant = not any("battery" in flight for flight in flights)
    return [_completed(flight, constant) for flight in flights]


def additions(flights: Sequence[Flight]) -> tuple[str, ...]:
    """Additions to the flights, each sentence once."""
    return tuple(dict.fromkeys(text for flight in flights for text in flight.provenance.added))


def _completed(flight: Flight, constant: bool) -> Flight:
    streams, added = dict(flight.streams), []
    mocap = streams.get("mocap")
    posed = mocap is not None and all(q in mocap for q in POSE)
    if mocap is not None and posed and "attitude_qw" not in streams:
        streams["attitude_qw"] = Stream(mocap.time_s, mocap[TURN], TURN, TURN, ("1",) * 4, mocap.frame, mocap.rate_hz)
        added.append("onboard attitude is not recorded; that of the motion capture is used")
    if mocap is not None and posed and not any(q in mocap for q in VELOCITY):
        velocity = _velocity(mocap)
        if velocity is not None:
            streams["mocap"] = replace(mocap, values=np.hstack([mocap.values, velocity]),
                                       columns=(*mocap.columns, *VELOCITY), quantities=(*mocap.quantities, *VELOCITY),
                                       unit=(*mocap.unit, "m/s", "m/s", "m/s"))
            added.append("velocity is not recorded; the derivative of the position is used")
    if constant and "motor" in streams and len(streams["motor"]):
        ends_s = streams["motor"].time_s[[0, -1]]
        streams["battery"] = Stream(ends_s, np.full((2, 1), ASSUMED_V), ("vbat",), ("vbat",), ("V",))
        added.append(f"battery voltage is not recorded; a constant {ASSUMED_V:g} V is assumed, so the thrust curve "
                     "holds for that assumption only")
    if not added:
        return flight
    return replace(flight, streams=streams, provenance=replace(flight.provenance, added=tuple(added)))


def _velocity(mocap: Stream) -> np.ndarray | None:
    """(n, 3) m/s: derivative of a local polynomial through the positions; None where too few are finite."""
    good = np.isfinite(mocap.time_s) & np.isfinite(mocap[POSITION]).all(axis=1)
    time_s, first = np.unique(mocap.time_s[good], return_index=True)
    position = mocap[POSITION][good][first]
    grid = np.arange(time_s[0], time_s[-1], STEP_S) if len(time_s) else np.empty(0)
    if len(grid) < ROWS:
        return None
    on_grid = np.stack([np.interp(grid, time_s, column) for column in position.T], axis=1)
    slope = savgol_filter(on_grid, ROWS, ORDER, deriv=1, delta=STEP_S, axis=0)
    return np.stack([np.interp(mocap.time_s, grid, column) for column in slope.T], axis=1)

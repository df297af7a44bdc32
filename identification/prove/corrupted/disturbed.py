"""A force that changes with time, added to what flew: no simulator can hold it, since a model does not know the time.

A vertical force moves the vehicle up and down, and does not turn it. The measured path gets the motion that such a
force makes against the nominal simulator's vertical drag, in its steady state. Attitude, rate and motors stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.mismatch.track import Track
from nanobench_tools import so3
from nanobench_tools.physics import Model


@dataclass(frozen=True)
class Disturbance:
    """name in the table; period (s); start and most of the search for an amplitude (m/s^2); near: terms that are no
    false names."""

    name: str
    period_s: float
    start: float = 0.02
    most: float = 4.0
    near: Sequence[str] = ()


DISTURBANCES = (Disturbance("force of time, 1 s", 1.0), Disturbance("force of time, 4 s", 4.0))


def disturbed(tracks: Sequence[Track], nominal: Model, amplitude_m_s2: float, period_s: float) -> tuple[Track, ...]:
    """The tracks of flights that a vertical force a sin(2 pi t / period) moved, with a phase for every flight."""
    omega, drag = 2.0 * np.pi / period_s, _drag(nominal)
    found = []
    for track in tracks:
        wave = amplitude_m_s2 * np.exp(1j * (omega * track.time_s + 2.4 * track.flight))
        velocity = wave / (1j * omega + drag)  # v' = a - drag v
        up = np.zeros((len(track), 3))
        position, speed, acceleration = (up.copy() for _ in range(3))
        position[:, 2], speed[:, 2] = (velocity / (1j * omega)).imag, velocity.imag
        acceleration[:, 2] = (1j * omega * velocity).imag
        found.append(replace(track, position_m=track.position_m + position, velocity_m_s=track.velocity_m_s + speed,
                             force_m_s2=track.force_m_s2 + so3.rotate_inverse(track.quaternion, acceleration)))
    return tuple(found)


def _drag(nominal: Model) -> float:
    """Of vertical speed, 1/s: drag along z and the inflow's slope at hover thrust."""
    d = nominal.values_of("drag_linear").get("d", (0.0, 0.0, 0.0))[2] / nominal.vehicle.mass_kg
    return float(d + nominal.values_of("inflow").get("k_z", 0.0) * nominal.vehicle.gravity_m_s2)

"""Quantities that a recording lacks, from those it has, as far as physics allows: heading, pitch, accelerations.

A quadrotor can only push along its own vertical axis. Without wind and drag its horizontal acceleration therefore gives
the direction of its thrust: a = |f| R e3 - g e3. With the yaw known, the tilt follows. Rates are the derivatives of the
attitude. Each quantity has its source; one that cannot be reconstructed is None.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from nanobench_tools import so3
from nanobench_tools.flight import Flight
from nanobench_tools.settings import count

SMOOTH_ROWS = count("mismatch.reconstruct.smooth_rows")
ORDER = 2
"""Savitzky-Golay filter of derivatives of velocity and attitude: 0.2 s of a 100 Hz log."""


@dataclass(frozen=True)
class States:
    """n rows on the clock of the motors.

    ``velocity``, ``acceleration`` (n, 3): world, m/s, m/s^2. ``yaw``, ``roll``, ``pitch`` (n,): rad or None. ``felt``
    (n, 3): mean accelerometer, m/s^2, in the frame of the heading without gravity, or None. ``sources``: source of
    each, with its standard deviation if it was reconstructed.
    """

    time_s: np.ndarray
    velocity_m_s: np.ndarray | None
    acceleration_m_s2: np.ndarray | None
    yaw_rad: np.ndarray | None
    roll_rad: np.ndarray | None
    pitch_rad: np.ndarray | None
    felt_m_s2: np.ndarray | None
    sources: dict[str, str]

    def heading(self, world: np.ndarray) -> np.ndarray:
        """Horizontal world vectors (n, 2+) -> forward and left (n, 2) of the vehicle's heading; as they are without a
        yaw."""
        if self.yaw_rad is None:
            return world[:, :2]
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        return np.stack([c * world[:, 0] + s * world[:, 1], -s * world[:, 0] + c * world[:, 1]], axis=1)


def states_of(flight: Flight) -> States:
    """All that can be known of how the vehicle moved. InputError without a motor stream."""
    time_s = flight["motor"].time_s
    sources: dict[str, str] = {}
    velocity = _velocity(flight, time_s, sources)
    acceleration = None
    if velocity is not None and len(time_s) > SMOOTH_ROWS:
        step = max(float(np.median(np.diff(time_s))), 1e-4)
        acceleration = savgol_filter(velocity, SMOOTH_ROWS, ORDER, deriv=1, delta=step, axis=0)
        sources["acceleration"] = "derivative of the velocity"
    roll, pitch, yaw = _attitude(flight, time_s, sources)
    states = States(time_s, velocity, acceleration, yaw, roll, pitch, None, sources)
    felt = None
    if "estimator_acc" in flight and yaw is not None:
        acc = flight["estimator_acc"]
        felt = np.column_stack([states.heading(acc.interpolate(("ax", "ay"), time_s)), acc.interpolate("az", time_s)])
        sources["felt"] = "accelerometer, turned into the world on board"
    return States(time_s, velocity, acceleration, yaw, roll, pitch, felt, sources)


def _velocity(flight: Flight, time_s: np.ndarray, sources: dict[str, str]) -> np.ndarray | None:
    for name in ("estimator", "mocap"):
        if name in flight and all(q in flight[name] for q in ("vx", "vy", "vz")) and len(flight[name]) > 1:
            sources["velocity"] = name
            return flight[name].interpolate(("vx", "vy", "vz"), time_s)
    return None


def _attitude(flight: Flight, time_s: np.ndarray, sources: dict[str, str]
              ) -> tuple[np.ndarray | None, np.ndarray | None, np.ndarray | None]:
    """roll, pitch, yaw (n,) rad, ZYX; yaw unwrapped."""
    if "attitude_qw" in flight and all(q in flight["attitude_qw"] for q in ("qx", "qy", "qz", "qw")):
        q = so3.interpolate(flight["attitude_qw"].time_s, flight["attitude_qw"]["qx", "qy", "qz", "qw"], time_s)
        angles = so3.euler_zyx(q)
        sources["attitude"] = "attitude_qw"
        return angles[:, 0], angles[:, 1], np.unwrap(angles[:, 2])
    if "attitude" not in flight:
        return None, None, None
    known = flight["attitude"]
    sources["attitude"] = "attitude: " + ", ".join(known.quantities)
    found = [np.interp(time_s, known.time_s, np.unwrap(known[n])) if n in known else None
             for n in ("roll", "pitch", "yaw")]
    return found[0], found[1], found[2]

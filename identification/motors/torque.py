"""Moments from measured rotor speed: what turns the vehicle, from the gyro's angular acceleration.

Thrust differences at the arms turn it about x and y: w' = M / J. This shows only arm k_f / J; with the arms of the
vehicle's table and k_f from a weighed mass that is J. About z a rotor's drag turns it, k_m T, and so does the reaction
to a rotor that speeds up, J_r dw/dt. Both sides are band-passed alike, because slow disturbances and vibration carry
no information on these ratios. The gyro is shifted by the lag at which they fit best.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

from nanobench_tools.physics.vehicle import Vehicle
from nanobench_tools.settings import number, setting

from .rotor_rows import Log

BAND_HZ = setting("motors.torque.band_hz")
SHIFTS_S = np.arange(-0.004, 0.0161, 0.0005)
SHORTEST_S = number("motors.torque.shortest_s")
EDGE_S = number("motors.torque.edge_s")


@dataclass(frozen=True)
class Axis:
    """values: what one flight's regression gives per unit of each moment; explained: share of variance; delay_s: of the
    gyro behind the rotor speed."""

    values: np.ndarray
    explained: float
    delay_s: float


def moments(log: Log, vehicle: Vehicle, k_f: float) -> dict[str, np.ndarray]:
    """(n, 1) N m about x and y; (n, 2) about z: sum spin T [N] and sum spin dw/dt [rad/s^2]."""
    thrust = k_f * log.speed**2
    arms, spin = np.array(vehicle.motor_positions_m), np.array(vehicle.spin)
    rise = np.gradient(log.speed, log.row_s, axis=0)
    return {"x": (thrust @ arms[:, 1])[:, None], "y": (-thrust @ arms[:, 0])[:, None],
            "z": np.stack([thrust @ spin, rise @ spin], axis=1)}


def regress(log: Log, axis: int, columns: np.ndarray, shifts_s: Sequence[float] | np.ndarray = SHIFTS_S) -> Axis | None:
    """Angular acceleration about ``axis`` against ``columns`` (n, k) at the best shift; None for too short a log."""
    sos = butter(2, BAND_HZ, btype="band", fs=1.0 / log.row_s, output="sos")
    pieces = [(a, b) for a, b in log.stretches if (b - a) * log.row_s >= SHORTEST_S]
    if not pieces:
        return None
    edge = round(EDGE_S / log.row_s)
    left = np.concatenate([sosfiltfilt(sos, columns[a:b], axis=0)[edge:-edge] for a, b in pieces])
    smooth = [sosfiltfilt(sos, np.gradient(log.rate[a:b, axis], log.row_s)) for a, b in pieces]
    best: Axis | None = None
    for shift in shifts_s:
        rows = [np.arange(len(s)) for s in smooth]
        right = np.concatenate([np.interp(r[edge:-edge] + shift / log.row_s, r, s)
                                for r, s in zip(rows, smooth, strict=True)])
        found = np.linalg.lstsq(left, right, rcond=None)[0]
        explained = 1.0 - float(np.sum((right - left @ found) ** 2) / np.sum(right**2))
        if best is None or explained > best.explained:
            best = Axis(found, explained, float(shift))
    return best


def command_lag(log: Log, vehicle: Vehicle, axis: int) -> float:
    """How late [s] the gyro's acceleration is behind the PWM's moment where the two look most alike: a figure often
    taken for a time constant. A lag of first order shows as atan(w tau) / w at the frequency w that dominates."""
    arms = np.array(vehicle.motor_positions_m)
    column = log.u @ (arms[:, 1] if axis == 0 else -arms[:, 0])
    found = regress(log, axis, column[:, None], np.arange(0.0, 0.1001, 0.001))
    return float("nan") if found is None else found.delay_s

"""Flights as a fit of thrust needs them: motor inputs and body-z specific force, low-passed at 3 Hz, on clean rows.

Only rows inside clean airborne spans count. They are more than 0.4 m above the resting place (no ground effect, no
touch-down), if the recording shows that place. They are also a quarter of a second inside the span (the filter has
settled). Nothing is filtered across the end of a span.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, lfilter, sosfiltfilt

from nanobench_tools import so3
from nanobench_tools.auditing.verb_needs import THRUST
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, Span
from nanobench_tools.protocols.phases import is_cut
from nanobench_tools.results import array_fields
from nanobench_tools.settings import count, number
from nanobench_tools.signals.airborne import resting_height_m
from nanobench_tools.units import PWM_FULL_SCALE

RATE_HZ = number("thrust.flight_rows.rate_hz")
EVERY = count("thrust.flight_rows.every")
CUT_HZ = number("thrust.flight_rows.cut_hz")
SETTLED_S = number("thrust.flight_rows.settled_s")
ABOVE_M = number("thrust.flight_rows.above_m")
EDGE_S = number("thrust.flight_rows.edge_s")

TRIM_S = number("thrust.flight_rows.trim_s")
HEAT_S = number("thrust.flight_rows.heat_s")

LIFT_S = number("thrust.flight_rows.lift_s")

CLIMB_OFF_S = number("thrust.flight_rows.climb_off_s")

FEWEST_ROWS = count("thrust.flight_rows.fewest_rows")

_FILTER = butter(2, CUT_HZ, fs=RATE_HZ, output="sos")
LEAST_MEAN = number("thrust.flight_rows.least_mean")


@dataclass(frozen=True)
class Flown:
    """n rows at 20 Hz. ``u`` (n, 4) PWM ratio, delayed by ``delay_s``; ``battery_V`` (n,); ``force`` (n,) body-z
    specific force m/s^2; ``climb`` (n,) body-z velocity m/s; ``across2`` (n,) its square across, m^2/s^2; ``heat``
    (n,) mean square motor voltage remembered over 5 s, V^2; ``trim`` (n, 3) roll, pitch, yaw imbalance of the inputs
    remembered over 20 s, as shares; ``lift`` (n, 6) PWM ratios and voltage, means of the last seconds in the air,
    and of how many [s] they are; ``time_s`` (n,). ``moving``: whether a velocity was known; ``epoch_s``: Unix time
    of the recording, 0 if unknown."""

    name: str
    path: str
    sha256: str
    delay_s: float
    time_s: np.ndarray
    u: np.ndarray
    battery_V: np.ndarray
    force: np.ndarray
    climb: np.ndarray
    across2: np.ndarray
    heat: np.ndarray
    trim: np.ndarray
    lift: np.ndarray
    moving: bool
    epoch_s: float = 0.0

    def __len__(self) -> int:
        return len(self.force)

    @property
    def voltage(self) -> np.ndarray:
        """(n,) V; the name of the same in a stand series."""
        return self.battery_V

    def rows(self, keep: slice | np.ndarray) -> Flown:
        return array_fields.rows(self, keep)


def fly(flight: Flight, spans: Sequence[Span], delay_s: float = 0.0) -> Flown:
    """The rows of ``flight`` inside ``spans`` (clean and airborne). InputError where nothing can be fitted."""
    place = flight.provenance.path
    for stream, quantities in THRUST.items():
        missing = [q for q in quantities if q not in flight[stream]]
        if missing:
            raise InputError(place, f"no {', '.join(missing)} in the {stream} stream", "thrust cannot be fitted")
    start = min(flight[s].time_s[0] for s in THRUST)
    grid = np.arange(start, max(flight[s].time_s[-1] for s in THRUST), 1.0 / RATE_HZ)
    motor = np.clip(flight["motor"].interpolate(THRUST["motor"], grid - delay_s), 0.0, 1.0)
    voltage = flight["battery"].interpolate("vbat", grid)
    force = flight["imu"].interpolate("acc_z", grid)
    velocity = _body_velocity(flight, grid)
    rows = _settled(flight, grid, spans)
    raw = np.column_stack([motor, voltage, force, np.zeros((len(grid), 3)) if velocity is None else velocity])
    smooth = np.full_like(raw, np.nan)
    for span in spans:
        stretch = slice(*np.searchsorted(grid, (span.start_s, span.end_s)))
        if stretch.stop - stretch.start > 30:
            smooth[stretch] = sosfiltfilt(_FILTER, raw[stretch], axis=0, padlen=24)
    rows &= np.isfinite(smooth).all(axis=1)
    pick = np.flatnonzero(rows)[::EVERY]
    if len(pick) < FEWEST_ROWS:
        raise InputError(place, f"{len(pick)} clean rows in the air (20 Hz, {ABOVE_M} m above the ground)",
                         f"a fit needs {FEWEST_ROWS}")
    smooth = smooth[pick]
    if np.ptp(smooth[:, :4], axis=0).max() * PWM_FULL_SCALE < 200.0:
        raise InputError(place, "PWM never changes in the air", "a thrust curve needs a range of PWM")
    memory = _remembered(motor, voltage)[pick]
    return Flown(flight.name, place, flight.provenance.sha256, delay_s, grid[pick], smooth[:, :4], smooth[:, 4],
                 smooth[:, 5], smooth[:, 8], smooth[:, 6] ** 2 + smooth[:, 7] ** 2, memory[:, 0], memory[:, 1:],
                 _carried(grid, spans, motor, voltage)[pick], velocity is not None, flight.epoch_s)


def _settled(flight: Flight, grid: np.ndarray, spans: Sequence[Span]) -> np.ndarray:
    height = _height(flight, grid)
    inside = np.zeros(len(grid), bool)
    margin = SETTLED_S if height is not None else EDGE_S
    for span in spans:
        inside |= (grid >= span.start_s + margin) & (grid <= span.end_s - margin)
    return inside if height is None else inside & (height > ABOVE_M)


def _height(flight: Flight, grid: np.ndarray) -> np.ndarray | None:
    """Height [m] above the place it stood; None where the recording starts in the air and stays near its lowest place:
    it never shows the ground."""
    for stream, quantity in (("mocap", "pz"), ("estimator", "z")):
        if stream in flight and quantity in flight[stream] and np.isfinite(flight[stream][quantity]).all():
            z = flight[stream][quantity]
            above = z - resting_height_m(z)
            if is_cut(flight) and float(above.max()) <= ABOVE_M:
                return None
            return np.asarray(np.interp(grid, flight[stream].time_s, above))
    return None


def _body_velocity(flight: Flight, grid: np.ndarray) -> np.ndarray | None:
    """(n, 3) m/s; from the motion capture, else from the vehicle's own estimate; None where neither is there."""
    for moves, turns in (("mocap", "mocap"), ("estimator", "attitude_qw")):
        wanted = {moves: ("vx", "vy", "vz"), turns: ("qx", "qy", "qz", "qw")}
        if all(s in flight and all(q in flight[s] for q in ("vx", "vy", "vz", "qx", "qy", "qz", "qw")
                                   if q in wanted[s] or s == turns == moves) for s in wanted):
            velocity = flight[moves].interpolate(("vx", "vy", "vz"), grid)
            pose = flight[turns]
            quaternion = so3.interpolate(pose.time_s, pose["qx", "qy", "qz", "qw"], grid)
            found = so3.rotate_inverse(quaternion, velocity)
            return found if np.isfinite(found).all() else None
    return None


def _remembered(motor: np.ndarray, voltage: np.ndarray) -> np.ndarray:
    """(n, 4): heat [V^2], trim of roll, pitch, yaw. Motors that do not run when the recording starts are cold."""
    heat = _low_pass(((motor * voltage[:, None]) ** 2).mean(axis=1), HEAT_S)
    slow = np.column_stack([_low_pass(m, TRIM_S) for m in motor.T])
    one, two, three, four = slow.T
    mean = 4.0 * np.maximum(slow.mean(axis=1), LEAST_MEAN)
    return np.column_stack([heat, (three + four - one - two) / mean, (one + four - two - three) / mean,
                            (one + three - two - four) / mean])


def _carried(grid: np.ndarray, spans: Sequence[Span], motor: np.ndarray, voltage: np.ndarray) -> np.ndarray:
    """(n, 6): means of the four motors and the voltage over clean rows in the air so far, and the number of seconds in
    them. The last LIFT_S count most. Rows before the first of these have 0 s."""
    first = min(span.start_s for span in spans) + CLIMB_OFF_S
    inside = np.zeros(len(grid))
    for span in spans:
        inside[(grid >= max(span.start_s, first)) & (grid <= span.end_s)] = 1.0
    columns = np.column_stack([motor, voltage, np.ones(len(grid))]) * inside[:, None]
    keep = float(np.exp(-1.0 / (RATE_HZ * LIFT_S)))
    remembered = lfilter([1.0 - keep], [1.0, -keep], columns, axis=0)
    count = remembered[:, -1:]
    return np.hstack([remembered[:, :-1] / np.where(count > 0.0, count, 1.0), LIFT_S * count])


def _low_pass(values: np.ndarray, constant_s: float) -> np.ndarray:
    keep = float(np.exp(-1.0 / (RATE_HZ * constant_s)))
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, zi=[values[0] * keep])[0])

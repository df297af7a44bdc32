"""Thrust-stand series as a fit needs them: rows that spin, thrust per motor without the zero of the load cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight
from nanobench_tools.results import array_fields
from nanobench_tools.settings import count, number, setting

MOTORS = 4
FEWEST_ROWS = count("thrust.stand_series.fewest_rows")
SPINNING_RAD_S = number("thrust.stand_series.spinning_rad_s")

NOISE_FACTOR = number("thrust.stand_series.noise_factor")
SHARE_OF_LARGEST = number("thrust.stand_series.share_of_largest")

THRUST_PER_VOLT_N = setting("thrust.stand_series.thrust_per_volt_n")

BATTERY_V = setting("thrust.stand_series.battery_v")
STEADY_V = number("thrust.stand_series.steady_v")


@dataclass(frozen=True)
class Stand:
    """One series; n rows that spin, in the order of the file.

    ``u`` (n,) PWM ratio of all motors; ``battery_V`` (n,) or None; ``thrust_N`` (n,) per motor, zero taken off;
    ``rotor2`` (n,) mean square rotor speed [rad^2/s^2] or None; ``current_A`` (n,) or None; ``zero_N``: what the load
    cell showed per motor at PWM 0 (nan: no such rows); ``still``: rows that do not spin.
    """

    name: str
    path: str
    sha256: str
    u: np.ndarray
    battery_V: np.ndarray | None
    thrust_N: np.ndarray
    rotor2: np.ndarray | None
    current_A: np.ndarray | None
    zero_N: float
    zero_rows: int
    still: int
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.u)

    @property
    def voltage(self) -> np.ndarray:
        """(n,) V; nan where none was measured."""
        return np.full(len(self), np.nan) if self.battery_V is None else self.battery_V

    @property
    def thrust_per_speed2(self) -> float:
        """k_f [N s^2/rad^2] of one propeller, nan without rotor speeds; it distinguishes propellers."""
        if self.rotor2 is None:
            return float("nan")
        return float(self.thrust_N @ self.rotor2 / (self.rotor2 @ self.rotor2))

    def rows(self, keep: slice | np.ndarray) -> Stand:
        return array_fields.rows(self, keep)


def is_stand(flight: Flight) -> bool:
    """Whether a recording is a stand series (with or without thrust in it) rather than a flight."""
    return "stand" in flight or flight.metadata.get("kind") == "stand"


def read_stand(flight: Flight) -> Stand:
    """The series in ``flight``. InputError in one line where there is nothing to fit."""
    place = flight.provenance.path
    if "stand" not in flight or "thrust" not in flight["stand"]:
        silent = next((f.evidence for f in flight.provenance.findings if "shows 0 in every row" in f.evidence), "")
        raise InputError(place, f"holds no thrust{': ' + silent if silent else ''}",
                         "a load cell that was not connected cannot be fitted")
    pwm = flight["motor"].values
    if not np.array_equal(pwm, np.broadcast_to(pwm[:, :1], pwm.shape), equal_nan=True):
        raise InputError(place, "the motors ran at different PWM, but the load cell shows their sum",
                         "a stand series has one PWM for all motors")
    u, total = pwm[:, 0], flight["stand"]["thrust"]
    voltage = flight["battery"]["vbat"] if "battery" in flight and "vbat" in flight["battery"] else None
    rotor = flight["rpm"].values if "rpm" in flight else None
    cell = flight["stand"]
    current = cell["current"] if "current" in cell else None  # noqa: SIM401  (a Stream is no dict)
    good = np.isfinite(u) & np.isfinite(total)
    for column in (voltage, current, *(() if rotor is None else rotor.T)):
        good &= True if column is None else np.isfinite(column)
    thrust = total / pwm.shape[1]
    at_zero = good & (u == 0.0) & (True if rotor is None else (rotor < SPINNING_RAD_S).all(axis=1))
    zero = float(np.median(thrust[at_zero])) if at_zero.any() else float("nan")
    thrust = thrust - zero if at_zero.any() else thrust
    spins = good & (u > 0.0) & _spins(thrust, at_zero, rotor)
    notes = [f"{int((~good).sum())} rows hold no number and were left out"] if not good.all() else []
    if at_zero.any():
        notes.append(f"zero of the load cell {1e3 * zero:.2f} mN per motor, from {int(at_zero.sum())} rows at rest")
    found = Stand(flight.name, place, flight.provenance.sha256, u[spins],
                  None if voltage is None else voltage[spins], thrust[spins],
                  None if rotor is None else (rotor[spins] ** 2).mean(axis=1),
                  None if current is None else current[spins], zero, int(at_zero.sum()),
                  int((good & ~spins).sum()), tuple(notes))
    check(found)
    return found


def _spins(thrust: np.ndarray, at_zero: np.ndarray, rotor: np.ndarray | None) -> np.ndarray:
    if rotor is not None:
        return np.asarray(rotor.mean(axis=1) > SPINNING_RAD_S)
    largest = np.nanmax(thrust, initial=0.0)
    noise = NOISE_FACTOR * float(np.std(thrust[at_zero])) if at_zero.sum() > 2 else 0.0
    return np.asarray(thrust > max(noise, SHARE_OF_LARGEST * largest))


def check(stand: Stand) -> None:
    """InputError where the rows cannot be fitted, or a unit cannot be right."""
    place = stand.path
    if stand.u.size and stand.u.max() > 1.0 + 1e-6:
        raise InputError(f"{place}: column pwm", f"largest PWM is {stand.u.max() * 65535:.0f} counts of 65535",
                         "give its unit in brackets: pwm[1] for a ratio")
    if len(stand) < FEWEST_ROWS:
        raise InputError(place, f"{len(stand)} rows spin ({stand.still} do not), and a fit needs {FEWEST_ROWS}",
                         "measure at more commands between the least that spins and full")
    if stand.u.max() < 1e-3:
        raise InputError(f"{place}: column pwm", f"largest PWM is {stand.u.max() * 65535:.2f} counts of 65535",
                         "a ratio is named pwm[1] in the header")
    if np.ptp(stand.u) < 0.02:
        raise InputError(f"{place}: column pwm", f"PWM never changes ({stand.u[0] * 65535:.0f} counts)",
                         "a thrust curve needs a range of PWM")
    volts = BATTERY_V  # of a file that does not say
    if stand.battery_V is not None:
        low, high = float(stand.battery_V.min()), float(stand.battery_V.max())
        if low < BATTERY_V[0] or high > BATTERY_V[1]:
            raise InputError(f"{place}: column vbat", f"battery from {low:.4g} to {high:.4g} V",
                             f"between {BATTERY_V[0]} and {BATTERY_V[1]} V is possible; is the unit mV?")
        volts = (high, high)
    peak = float(np.quantile(stand.thrust_N, 0.98))
    if not THRUST_PER_VOLT_N[0] * volts[0] <= peak <= THRUST_PER_VOLT_N[1] * volts[1]:
        at = "" if stand.battery_V is None else f" at {volts[1]:.3g} V"
        raise InputError(f"{place}: thrust", f"largest thrust is {peak:.3g} N per motor{at}",
                         "that is no motor: give the unit in brackets, weight[g], thrust[N]")

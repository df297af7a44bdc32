"""A fitted map taken elsewhere: terms of a simulator.toml, a CasADi function for an MPC, constants of the firmware."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

from nanobench_tools.physics.ops import casadi_ops, import_casadi
from nanobench_tools.settings import number, setting

from .firmware import LOWEST_BATTERY_V, constants, motor_voltage
from .maps import Map
from .stand_fit import Fit

DEGREE = 3
"""Of the polynomial of the motor voltage that stands for a map the simulator has no term for."""

GRID = 41
LEAST_CUBES = setting("thrust.map_export.least_cubes")

SOLVED_WITHIN = number("thrust.map_export.solved_within")

LEAST_SHARE = 7000.0 / 65535.0
"""Commands below it stop the motors: the firmware's THRUST_MIN is this share of its THRUST_MAX, to 0.01 %."""


@dataclass(frozen=True)
class Exported:
    """A map as terms of a simulator and as lines for the firmware.

    - terms: entries of ``[[terms]]``.
    - rms_N: difference between their thrust and the map's over the PWM and voltages of the training rows. It is 0 for
      a map that is a term itself.
    - firmware: lines to paste, empty with the reason in ``note``."""

    terms: tuple[Mapping[str, Any], ...]
    rms_N: float
    firmware: str
    note: str

    def toml(self) -> str:
        """The terms as text for a simulator.toml."""
        lines = []
        for term in self.terms:
            lines += ["[[terms]]", f'name = "{term["name"]}"']
            lines += [f"{key} = {[float(f'{x:.10g}') for x in value]}" if isinstance(value, (list, tuple))
                      else f"{key} = {value:.10g}" for key, value in term.items() if key != "name"]
        return "\n".join([*lines, ""])


def export(fit: Fit, u: tuple[float, float], voltage: tuple[float, float], scale: float = 1.0,
           more: tuple[Mapping[str, Any], ...] = ()) -> Exported:
    """What a simulator and the firmware take over of ``fit``, for PWM ratios and voltages from lowest to highest.

    scale: a factor on the thrust (warm motors); more: further terms that belong to it.
    """
    grid_u = np.linspace(*u, GRID)[:, None]
    grid_v = np.linspace(*voltage, GRID)[None, :] if np.isfinite(voltage[0]) else np.full((1, 1), 4.0)
    thrust = scale * fit.predict(grid_u, grid_v)
    name = fit.map.name
    if name == "thrust_pwm":
        own = {"name": "thrust_pwm", "c": [scale * fit.values[n] for n, _ in fit.map.linear]}
        return Exported((own, *more), 0.0, "", "the firmware's formula needs the motor voltage, this map has none")
    c, rms = motor_voltage_polynomial(fit.map, fit.values, grid_u, grid_v, thrust, scale)
    drive = np.broadcast_to(grid_u * grid_v, thrust.shape).ravel()
    highest = float(scale * fit.predict(u[1], voltage[0]))
    lines, note = _firmware(drive, thrust.ravel(), highest, name)
    return Exported(({"name": "thrust_voltage", "c": list(c)}, *more), rms, lines, note)


def motor_voltage_polynomial(candidate: Map, values: Mapping[str, float], u: np.ndarray, voltage: np.ndarray,
                             thrust: np.ndarray, scale: float) -> tuple[tuple[float, ...], float]:
    """(c_k of sum c_k (u V)^k, RMS distance [N] to ``thrust``): the map's own where it is one, else least squares."""
    drive = np.broadcast_to(u * voltage, thrust.shape).ravel()
    if candidate.name == "thrust_voltage" or candidate.fixed is not None:
        return tuple(scale * values[n] for n, _ in candidate.linear), 0.0
    found = np.polynomial.Polynomial.fit(drive, thrust.ravel(), DEGREE).convert().coef
    found = np.pad(found, (0, DEGREE + 1 - len(found)))
    return tuple(map(float, found)), _rms(found, drive, thrust.ravel())


def _rms(c: Any, drive: np.ndarray, thrust: np.ndarray) -> float:
    return float(np.sqrt(np.mean((np.polynomial.polynomial.polyval(drive, c) - thrust) ** 2)))


def rising_cubic(drive: np.ndarray, thrust: np.ndarray, least_c3: float = LEAST_CUBES[0]) -> np.ndarray:
    """c_k (4,) of the cubic nearest to ``thrust`` that rises everywhere, which the firmware's inverse needs.

    With slope and c_3 above zero, c_0 + slope V + c_3 ((V - p)^3 + p^3) has a positive derivative everywhere; p is
    scanned.
    """
    top = float(drive.max())
    best: tuple[float, np.ndarray] = (np.inf, np.zeros(DEGREE + 1))
    for p in np.linspace(-top, top, 81):
        columns = np.stack([np.ones_like(drive), drive, (drive - p) ** 3 + p**3], axis=1)
        size = np.abs(columns).max(axis=0)
        found = lsq_linear(columns / size, thrust, ([-np.inf, 1e-6, least_c3 * size[2]], [np.inf] * 3), method="bvls")
        c0, slope, c3 = found.x / size
        best = min(best, (found.cost, np.array([c0, slope + 3.0 * c3 * p * p, -3.0 * c3 * p, c3])), key=lambda x: x[0])
    return best[1]


def solved_on_vehicle(c: np.ndarray, least_N: float, highest_N: float) -> bool:
    """Whether the firmware's formula in single precision finds the voltages of all thrusts it may get."""
    commanded = np.linspace(least_N, highest_N, 101)
    given = np.polynomial.polynomial.polyval(motor_voltage(commanded, c, np.float32).astype(float), c)
    return bool(np.all(np.abs(given - commanded) < SOLVED_WITHIN * highest_N))


def _firmware(drive: np.ndarray, thrust: np.ndarray, highest_N: float, name: str) -> tuple[str, str]:
    least = LEAST_SHARE * highest_N
    tried = (rising_cubic(drive, thrust, c3) for c3 in LEAST_CUBES)
    c = next((x for x in tried if x[0] < least and solved_on_vehicle(x, least, highest_N)), None)
    if c is None:
        return "", ("no constants: no cubic near this map gives less than the least command at 0 V and is solved in "
                    "the firmware's single precision")
    comment = f"nanobench thrust: {name} as cubic of PWM/65535 vbat, RMS {1e3 * _rms(c, drive, thrust):.2f} mN from it"
    note = ("for platform_defaults_cf2.h; THRUST_MAX is what full PWM gives at the lowest battery voltage of the "
            f"training rows; the firmware stops the motors below {LOWEST_BATTERY_V} V")
    return constants(c, least, highest_N, comment), note


def casadi_function(fit: Fit, scale: float = 1.0) -> Any:
    """casadi.Function (u, V) -> T [N] of one motor, with derivatives. MissingExtraError without CasADi."""
    ca = import_casadi()
    u, voltage = ca.SX.sym("u"), ca.SX.sym("V")
    thrust = scale * fit.map.thrust(fit.values, u, voltage, casadi_ops())
    return ca.Function(f"thrust_{fit.map.name}", [u, voltage], [thrust], ["u", "V"], ["T"])


def flight_terms(values: Mapping[str, float]) -> tuple[Mapping[str, Any], ...]:
    """The effects of a flight fit that the simulator has terms for."""
    return ({"name": "inflow", "k_z": values["k_z"], "k_h": values["k_h"]},)

"""A thrust map as a formula with its numbers and units, and what it gives at hover and at full command."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from nanobench_tools.results.result import OPTIONAL, Result

from .maps import MONOMIALS, Map

MEANING = ("T: thrust of one motor [N]; u: command of a motor [0..1], PWM / 65535 or (pulse - 1000 us) / 1000 us; "
           "V: battery voltage under load [V]")
FULL_CELL_V, EMPTY_CELL_V = 4.2, 3.0
"""Voltage of a lithium cell after charging, and where it has to be spared."""
MOST_CELL_V = 4.35
"""More than this is more than one cell in series."""
SAG_TERMS = 4
"""Terms of the polynomial from command to the voltage of a sagging battery."""
LEAST_VARIATION = 0.005
"""Of the voltage at one command, as a share: 20 mV of one cell; less is noise of the reading."""
DIGITS = 4
MOTORS = 4
Predict = Callable[[np.ndarray, float], np.ndarray]
"""(PWM ratios, battery voltage V) -> thrust of one motor N."""


@dataclass(frozen=True, repr=False)
class ThrustLevel(Result):
    """At one battery voltage.

    - hover_pwm: the ratio that carries the weight (None: full command does not).
    - full_N: of one motor at full command; thrust_to_weight: of all motors there.
    - measured: the voltage is one of the training rows'."""

    battery: str
    voltage_V: float
    hover_pwm: float | None
    full_N: float
    thrust_to_weight: float
    measured: bool


@dataclass(frozen=True, repr=False)
class ThrustFormula(Result):
    """``text``: with numbers and units; levels at a full and an empty battery; hover_N of one motor, of mass_kg;
    ``voltage_V``: of the training rows, lowest and highest. No levels where the voltage of the rows follows from the
    command alone: then no row shows how thrust depends on voltage. ``sagged_N``: of one motor at full command and the
    lowest voltage of the rows."""

    text: str
    mass_kg: float
    hover_N: float
    voltage_V: tuple[float, float]
    levels: tuple[ThrustLevel, ...]
    sagged_N: float | None = field(default=None, metadata=OPTIONAL)

    @property
    def sentence(self) -> str:
        """Thrust at hover and at full command, one line."""
        return self.described()

    def described(self, option: str = "") -> str:
        """``sentence``. option: the one that gives a mass, where none was given and the usual one is assumed."""
        return " ".join(self.lines(option))

    def lines(self, option: str = "") -> list[str]:
        """``described`` as one line for the hover, and one a battery."""
        if not self.levels and not np.isfinite(self.voltage_V).all():
            full = "" if self.sagged_N is None else f"{newton(self.sagged_N)} per motor at full command. "
            return [f"{full}The rows have no voltage; do not use the formula with another battery"]
        if not self.levels:
            full = "" if self.sagged_N is None else (
                f"{newton(self.sagged_N)} per motor at full command and {self.voltage_V[0]:.2f} V. ")
            return [f"{full}Rows have {self.voltage_V[0]:.2f} to {self.voltage_V[1]:.2f} V, always the same at "
                    "the same command. They do not show how thrust depends on voltage: do not use the formula at other "
                    "voltages"]
        assumed = f" (assumed: give {option})" if option else ""
        lines = [f"Hover of {1e3 * self.mass_kg:g} g{assumed} takes {newton(self.hover_N)} per motor."]
        for level in self.levels:
            hover = "no hover" if level.hover_pwm is None else f"hover at u = {level.hover_pwm:.3f}"
            beyond = "" if level.measured else ", extrapolated"
            lines.append(f"{level.battery.capitalize()} battery ({level.voltage_V:.2f} V{beyond}): {hover}, "
                         f"{newton(level.full_N)} at full command ({level.thrust_to_weight:.2f} x weight).")
        return [*lines, f"Rows have {self.voltage_V[0]:.2f} to {self.voltage_V[1]:.2f} V."]


def newton(force_N: float) -> str:
    """A force with its unit.

    >>> newton(0.1002), newton(18.63)
    ('100.2 mN', '18.63 N')
    """
    return f"{force_N:.4g} N" if force_N >= 1.0 else f"{1e3 * force_N:.1f} mN"


def written(candidate: Map, values: Mapping[str, float], scale: float = 1.0) -> str:
    """The map as text: numbers with units, ``^`` for powers, ``scale`` multiplied into its coefficients.

    Evaluated with u and V it gives the thrust of one motor before it is cut at zero.
    """
    numbers = [scale * values[name] for name, _ in candidate.linear]
    units = [unit for _, unit in candidate.linear]
    terms = [(c, unit, column) for c, unit, column in zip(numbers, units, _columns(candidate, values), strict=True)]
    text = ""
    for c, unit, column in terms:
        factor = f"{abs(c):.{DIGITS}g}" + ("" if unit == "1" else f" {unit}") + (f" * {column}" if column else "")
        text += (" - " if text else "-") * (c < 0.0) + " + " * (bool(text) and c >= 0.0) + factor
    return f"T = {text}"


def _columns(candidate: Map, values: Mapping[str, float]) -> list[str]:
    """What each coefficient multiplies; empty for a constant."""

    def powers(base: str, count: int) -> list[str]:
        return ["", base, *(f"{base}^{k}" for k in range(2, count))][:count]

    def number(name: str, unit: str) -> str:
        return f"{values[name]:.{DIGITS}g} {unit}"

    def plus(base: str, name: str) -> str:
        return f"{base} {'-' if values[name] < 0.0 else '+'} {abs(values[name]):.{DIGITS}g} V"

    name, count = candidate.name, len(candidate.linear)
    if name == "thrust_pwm":
        return powers("u", count)
    if name == "thrust_voltage" or candidate.fixed is not None:
        return powers("(u * V)", count)
    if name.startswith("scaled_"):
        published = next(c for key, c in _cubics().items() if name.endswith(key))
        cubic = " + ".join(f"{c:.{DIGITS}g} N{f'/V^{k}' if k > 1 else '/V' * k}" + f" * {x}" * bool(x)
                           for k, (c, x) in enumerate(zip(published, powers("(u * V)", 4), strict=True)))
        return [f"({cubic})"]
    if name == "power_law":
        return [f"u^{values['a']:.{DIGITS}g} * V^{values['b']:.{DIGITS}g}"]
    if name == "dc_motor":
        drive = f"({plus('u * V', 'e_0')})"
        return [f"(2 * {drive} / (1 + (1 + 4 * {number('rho', '1/V')} * {drive})^0.5))^2"]
    if name == "switched_motor":
        switched = plus("V", "s")
        return [f"({plus(f'u * ({switched})', 'e_0')})^2"]
    return [" * ".join(filter(None, (f"u^{a}" if a > 1 else "u", "" if not b else f"V^{b}" if b > 1 else "V")))
            for a, b in MONOMIALS]


def _cubics() -> dict[str, tuple[float, ...]]:
    from .firmware import LEGACY, PLUS

    return {propellers.name: tuple(propellers.c) for propellers in (PLUS, LEGACY)}


def voltage_varies(u: np.ndarray, battery_V: np.ndarray) -> bool:
    """Whether rows have different voltages at the same command. u: (n,), or (n, 4) of the motors; battery_V: (n,)."""
    u = u.reshape(len(u), -1).mean(axis=1)
    known = np.isfinite(u) & np.isfinite(battery_V)
    if known.sum() <= SAG_TERMS + 1:
        return False
    powers = np.vander(u[known], SAG_TERMS)
    left = battery_V[known] - powers @ np.linalg.lstsq(powers, battery_V[known], rcond=None)[0]
    return bool(np.std(left) > LEAST_VARIATION * np.mean(battery_V[known]))


def formula_of(text: str, predict: Predict, mass_kg: float, gravity_m_s2: float,
               voltage_V: tuple[float, float], varies: bool = True) -> ThrustFormula:
    """What the map gives at hover and at full command. voltage_V: lowest and highest of the training rows; varies: see
    ``voltage_varies``."""
    hover_N = mass_kg * gravity_m_s2 / MOTORS
    low, high = voltage_V
    cells = max(1, int(np.ceil(high / MOST_CELL_V))) if np.isfinite(high) else 1
    levels: list[ThrustLevel] = []
    for battery, cell_V in (("full", FULL_CELL_V), ("empty", EMPTY_CELL_V)) if varies else ():
        volts = cells * cell_V
        u = np.linspace(0.0, 1.0, 1001)
        curve = np.maximum.accumulate(predict(u, volts))
        full_N = float(curve[-1])
        hover = float(np.interp(hover_N, curve, u)) if full_N >= hover_N else None
        levels.append(ThrustLevel(battery, volts, hover, full_N, full_N / hover_N, bool(low <= volts <= high)))
    sagged_N = float(np.max(predict(np.linspace(0.0, 1.0, 1001), low)))
    return ThrustFormula(text, mass_kg, hover_N, voltage_V, tuple(levels), sagged_N)

"""Candidates for the thrust of one motor from its PWM ratio u and the battery voltage V.

Each is T = sum_k c_k x_k(u, V; shape): linear in the coefficients c, with at most two shape parameters inside. One
expression serves NumPy arrays and CasADi symbols. The polynomials are those of the terms ``thrust_pwm`` and
``thrust_voltage``.

The motor family comes from the steady balance of a DC motor with a propeller. Speed voltage E = K_e w and current I: u
(V + s) - d = E + R I. The drop is d + (1 - u) s while the switch is off. It comes from the diode and the battery's own
resistance, through which the current flows in bursts. Torque balance K_t I = k_q w^2, so R I = rho E^2; propeller T =
k_f w^2 = kappa E^2. Hence E + rho E^2 = u (V + s) + e_0 with e_0 = -d.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from nanobench_tools.physics.ops import NUMPY, Ops
from nanobench_tools.physics.term import Stage
from nanobench_tools.physics.terms.thrust_pwm import TERM as THRUST_PWM
from nanobench_tools.physics.terms.thrust_voltage import TERM as THRUST_VOLTAGE
from nanobench_tools.settings import setting

from .firmware import LEGACY, PLUS, PropellerSet


@dataclass(frozen=True)
class Shape:
    """A parameter inside the columns. ``low`` and ``high``: a fit that ends there is invalid. ``prior``: (mean, SD)."""

    name: str
    unit: str
    low: float
    high: float
    start: float
    prior: tuple[float, float] | None = None


Numbers = Sequence[float] | np.ndarray
Columns = Callable[[Any, Any, Any, Ops], Sequence[Any]]


@dataclass(frozen=True)
class Map:
    """``columns(shape values, u, V, ops)`` -> one column per entry of ``linear`` [(name, unit)]; T = sum c_k column_k.

    - fixed: coefficients that are given and not fitted.
    - positive: the coefficient has to be above zero.
    - rank: of maps that predict equally well, the lowest rank is chosen. A motor, which extrapolates, comes before
      polynomials, these before a curve of other propellers, and maps without the voltage last.
    """

    name: str
    equation: str
    linear: tuple[tuple[str, str], ...]
    columns: Columns
    shape: tuple[Shape, ...] = ()
    fixed: tuple[float, ...] | None = None
    uses_voltage: bool = True
    positive: bool = False
    rank: int = 1

    @property
    def size(self) -> int:
        """How many numbers are fitted."""
        return 0 if self.fixed is not None else len(self.linear) + len(self.shape)

    def design(self, shape: Numbers, u: np.ndarray, voltage: np.ndarray) -> np.ndarray:
        """(k, ...) columns over u (...) and voltage (...)."""
        found = self.columns(shape, u, voltage, NUMPY)
        return np.stack([np.broadcast_to(c, np.broadcast_shapes(np.shape(u), np.shape(voltage))) for c in found])

    def thrust(self, values: Mapping[str, Any], u: Any, voltage: Any, ops: Ops = NUMPY) -> Any:
        """Thrust [N] of a motor, never below zero; ``values`` by name of parameter."""
        shape = [values[s.name] for s in self.shape]
        total = 0.0
        for (name, _), column in zip(self.linear, self.columns(shape, u, voltage, ops), strict=True):
            total = total + values[name] * column
        return ops.fmax(total, 0.0 * u)

    @property
    def units(self) -> dict[str, str]:
        return {**dict(self.linear), **{s.name: s.unit for s in self.shape}}


def _term_columns(term: Any, count: int) -> Columns:
    """Columns of a polynomial term: the term itself with unit coefficients."""
    expression = term.acts[Stage.THRUST_MAP]

    def columns(shape: Sequence[Any], u: Any, voltage: Any, ops: Ops) -> list[Any]:
        at = SimpleNamespace(battery_V=voltage)
        return [expression([u], SimpleNamespace(c=tuple(float(i == k) for i in range(k + 1))), at, ops)[0]
                for k in range(count)]

    return columns


def _polynomial(name: str, term: Any, degree: int, equation: str, **more: Any) -> Map:
    parameter = term.parameters[0]
    linear = tuple((f"c[{k}]", parameter.unit_of(k)) for k in range(degree + 1))
    return Map(name, equation, linear, _term_columns(term, degree + 1), **more)


MONOMIALS = ((1, 0), (1, 1), (2, 0), (2, 1), (2, 2), (3, 3))
"""Powers (of u, of V) of the general polynomial: u and u^2 with any voltage law up to their own power. Also the cube
of the motor voltage. No constant: a motor that is off pulls nothing."""


def _general(shape: Sequence[Any], u: Any, voltage: Any, ops: Ops) -> list[Any]:
    return [u**a * voltage**b if b else u**a + 0.0 * voltage for a, b in MONOMIALS]


def speed_voltage(drive: Any, rho: Any, ops: Ops) -> Any:
    """E of E + rho E^2 = drive [V], 0 below; written so that rho = 0 is no special case."""
    drive = ops.fmax(drive, 0.0 * drive)
    return 2.0 * drive / (1.0 + ops.sqrt(1.0 + 4.0 * rho * drive))


def _dc_motor(shape: Sequence[Any], u: Any, voltage: Any, ops: Ops) -> list[Any]:
    rho, offset = shape
    return [speed_voltage(u * voltage + offset, rho, ops) ** 2]


def _switched_motor(shape: Sequence[Any], u: Any, voltage: Any, ops: Ops) -> list[Any]:
    offset, drop = shape
    return [speed_voltage(u * (voltage + drop) + offset, 0.0, ops) ** 2]


def _power(shape: Sequence[Any], u: Any, voltage: Any, ops: Ops) -> list[Any]:
    of_u, of_v = shape
    return [ops.fmax(u, 1e-9) ** of_u * voltage**of_v]


def _scaled(propellers: PropellerSet) -> Columns:
    polynomial = _term_columns(THRUST_VOLTAGE, len(propellers.c))

    def columns(shape: Sequence[Any], u: Any, voltage: Any, ops: Ops) -> list[Any]:
        return [sum(c * x for c, x in zip(propellers.c, polynomial(shape, u, voltage, ops), strict=True))]

    return columns


def firmware_map(propellers: PropellerSet) -> Map:
    """The firmware's own map, nothing fitted."""
    return _polynomial(f"firmware_{propellers.name}", THRUST_VOLTAGE, 3,
                       f"the firmware's cubic for {propellers.words}, as published", fixed=propellers.c)


DROP_PRIOR_V = setting("thrust.maps.drop_prior_v")

FROM_ELSEWHERE = 2
"""Rank of maps whose law of the voltage was measured on other motors."""

MAPS: dict[str, Map] = {m.name: m for m in (
    firmware_map(PLUS),
    firmware_map(LEGACY),
    Map(f"scaled_{PLUS.name}", f"s x cubic for {PLUS.words}", (("s", "1"),), _scaled(PLUS), positive=True,
        rank=FROM_ELSEWHERE),
    Map(f"scaled_{LEGACY.name}", f"s x cubic for {LEGACY.words}", (("s", "1"),), _scaled(LEGACY),
        positive=True, rank=FROM_ELSEWHERE),
    _polynomial("thrust_pwm", THRUST_PWM, 2, "T = sum c_k u^k, no voltage", uses_voltage=False, rank=3),
    _polynomial("thrust_voltage", THRUST_VOLTAGE, 3, "T = sum c_k (u V)^k"),
    Map("power_law", "T = c u^a V^b", (("c", "N"),), _power,
        (Shape("a", "1", 0.2, 5.0, 1.8), Shape("b", "1", 0.0, 5.0, 1.5)), positive=True),
    Map("dc_motor", "T = kappa E^2, E + rho E^2 = u V + e_0", (("kappa", "N/V^2"),), _dc_motor,
        (Shape("rho", "1/V", 0.0, 5.0, 0.08), Shape("e_0", "V", -2.0, 4.0, 0.02)),
        positive=True, rank=0),
    Map("switched_motor", "T = kappa (u (V + s) + e_0)^2", (("kappa", "N/V^2"),), _switched_motor,
        (Shape("e_0", "V", -2.0, 6.0, 0.5), Shape("s", "V", -2.0, 8.0, DROP_PRIOR_V[0], DROP_PRIOR_V)), positive=True,
        rank=0),
    Map("pwm_voltage", "T = sum c_ab u^a V^b",
        tuple((f"c[{a},{b}]", "N" if not b else "N/V" if b == 1 else f"N/V^{b}") for a, b in MONOMIALS), _general),
)}
"""All candidates, the simplest first among those of one kind."""

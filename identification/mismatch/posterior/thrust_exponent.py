"""How far the shape of a thrust map may change: the exponent of thrust over its input stays that of a rotor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nanobench_tools.physics import Model
from nanobench_tools.settings import setting

from ..track import joined
from ..wrench import Wrench

EXPONENTS: dict[str, tuple[float, float]] = setting("posterior.thrust_exponent.exponents")
"""Least and largest local exponent of thrust over the input of each map."""
ROOM = 0.01
"""Of an exponent: a simulator outside the range may move so far away from it, which is nothing."""


@dataclass(frozen=True)
class Curve:
    """A thrust map at the usual input ``at`` of the flights: coefficients from power 0, and the exponents that rotors
    have."""

    coefficients: np.ndarray
    at: float
    exponents: tuple[float, float]

    @classmethod
    def of(cls, wrench: Wrench, model: Model, term: str) -> Curve:
        """The map ``term`` of a model."""
        judged = np.concatenate([t.counts for t in wrench.tracks])
        put = joined(wrench.tracks, "motor")[judged]
        if term == "thrust_voltage":
            put = put * joined(wrench.tracks, "battery_V")[judged][:, None]
        return cls(np.array(model.values_of(term)["c"]), float(np.median(put)), EXPONENTS[term])

    def room(self, way: np.ndarray) -> tuple[float, float]:
        """How far the coefficients may move along ``way``, down and up, until the exponent leaves its range. The range
        contains the simulator's exponent.

        >>> Curve(np.array([0.0, 0.0, 1.0]), 2.0, (1.5, 2.5)).room(np.array([1.0, 0.0, 0.0]))
        (-0.8, 1.333...)
        """
        of = np.polynomial.polynomial
        thrust, more = (float(of.polyval(self.at, c)) for c in (self.coefficients, way))
        slope, steeper = (float(of.polyval(self.at, of.polyder(c))) * self.at for c in (self.coefficients, way))
        here = slope / thrust
        ends = [(end * thrust - slope) / (steeper - end * more)
                for end in (min(self.exponents[0], here - ROOM), max(self.exponents[1], here + ROOM))
                if steeper != end * more]
        return max((e for e in ends if e < 0.0), default=-np.inf), min((e for e in ends if e > 0.0), default=np.inf)

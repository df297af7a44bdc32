"""Forces and moments that small errors of terms and of logging would have to explain, although they are too small.

Every term may be a little wrong, and every log a little off. Where flights require more than that, something else is
there, which only resembles these errors.
"""

from __future__ import annotations

import numpy as np

from nanobench_tools.settings import number

from .background import FIXED
from .build import Case
from .sizing import Refined, nuisance

FAR = number("posterior.strained.far")
"""Standard deviations."""


def strained(case: Case, found: Refined) -> tuple[np.ndarray, np.ndarray]:
    """Force (N, 3) m/s^2 and moment (M, 3) rad/s^2 along errors of FAR standard deviations and more, and along terms
    that were given up."""
    evidence = case.evidence
    coefficients = nuisance(case, found)
    far = np.abs(coefficients) > FAR * evidence.deviations(evidence.takes_lift(found.chosen))
    fixed = coefficients[evidence.P:] * (far[evidence.P:] & (case.background.group == FIXED))
    force, torque = case.background.force @ fixed, case.background.torque @ fixed
    for i, effect in enumerate(case.effects):
        mine = evidence.columns((i,))
        taken = coefficients[mine] * (far[mine] | (effect.term in evidence.given_up)) / evidence.unit[mine]
        force, torque = force + effect.force @ taken, torque + effect.torque @ taken
    return force, torque

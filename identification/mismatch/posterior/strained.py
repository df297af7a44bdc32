"""Forces and moments that errors of logging would have to explain, although they are too small.

Every log is a little off. Where flights require more than that, something else is there, which only resembles such an
error. A term that was given up only resembles what is there, too.
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
    """Force (N, 3) m/s^2 and moment (M, 3) rad/s^2: along errors of logging beyond FAR, and along terms that were given
    up."""
    evidence = case.evidence
    coefficients = nuisance(case, found)
    logged = coefficients[evidence.P:]
    fixed = logged * ((case.background.group == FIXED) & (np.abs(logged) > FAR))  # their standard deviation is 1
    force, torque = case.background.force @ fixed, case.background.torque @ fixed
    for i, effect in enumerate(case.effects):
        mine = evidence.columns((i,))
        if effect.term in evidence.given_up:
            taken = coefficients[mine] / evidence.unit[mine]
            force, torque = force + effect.force @ taken, torque + effect.torque @ taken
    return force, torque

"""A load on a string.

A model of terms describes the load below the frequency of its swing. There it hangs under its knot and moves along,
as a weight there would. The swing itself has two more states than a model; ``pendulum.swing`` integrates it in
addition to a model. A diagnosis looks for it as a force that comes and goes
(``identification/mismatch/steady/periodic.py``). A fit cannot identify the length from flights that are evaluated
without the swing. There is no neutral length, so the term is not searched for among the causes of a residual.

Parameters
----------
m_kg : float, kg
    Mass of the load.
l_m : float, m
    Length of the string.
zeta : float, 1
    Damping ratio of the swing.
r_m : (3,) m
    From the centre of mass to the knot, body x, y and z.
"""

from types import SimpleNamespace
from typing import Any

from ..ops import Ops
from ..systematic import NOTHING
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components, cross, scale, subtract


def mass(value: Any, p: SimpleNamespace, at: Situation, ops: Ops) -> Any:
    return value + p.m_kg


def moment(torque: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    share = p.m_kg / (at.vehicle.mass_kg + p.m_kg)
    return subtract(torque, scale(share, cross(p.r_m, at.force_b)))


TERM = Term(
    name="slung_load",
    sentence="A load m on a string of length l, knotted at r, weighs there, and swings at some sqrt(g / l) / 2 pi.",
    equation="M <- M + m; tau <- tau - m / (M + m) r x F_b; in addition s'' = -(g / l) s - 2 zeta sqrt(g / l) s' - "
             "a_knot, F <- F + m g s / l",
    parameters=(
        Parameter("m_kg", "kg", 0.0, 1.0, 0.004, systematic=NOTHING,
                  source="CrazyPAD: a few grams on a thread of 0.63 m"),
        Parameter("l_m", "m", 0.05, 10.0, 0.6, neutral=None, systematic=NOTHING, source="CrazyPAD: 0.63 m"),
        Parameter("zeta", "1", 0.0, 1.0, 0.03, systematic=NOTHING,
                  source="a small sphere of 4 g in air: swings for half a minute"),
        Parameter("r_m", "m", -0.5, 0.5, 0.0, length=3, systematic=NOTHING, source="within the reach of the motors")),
    acts={Stage.MASS: mass, Stage.TORQUE: moment},
    confused_with={"mass": "a sideways step, higher than the string is long: only a load on a string swings",
                   "com_offset": "a weighing: a load on a string adds mass"},
)

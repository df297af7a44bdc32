"""Thrust from rotor speed, and rotor speed from thrust where others ask for it.

Parameters
----------
k_f : float, N s^2/rad^2
    Thrust of one rotor over its squared speed.

References
----------
- Mahony, Kumar, Corke 2012, "Multirotor aerial vehicles: Modeling, estimation, and control of quadrotor", IEEE
  Robotics & Automation Magazine 19(3), doi:10.1109/MRA.2012.2206474.
- Folk, Paulos, Kumar 2023, "RotorPy", arXiv 2306.04485.
"""

from types import SimpleNamespace
from typing import Any

from ..ops import Ops
from ..systematic import NOTHING
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components

STILL_N = 1e-15
"""Thrust below which a rotor counts as standing; keeps the derivative of the square root finite (0.2 mrad/s)."""


def thrust(inputs: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> Components:
    if at.vehicle.input != "rpm":  # another map gives thrust; k_f only turns it into speed
        return inputs
    return [p.k_f * omega * omega for omega in inputs]


def speed(lagged: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    """Omega = sqrt(T / k_f). With measured speeds, scale imbalance belong to k_f; the speed stays."""
    gain = at.gain if at.vehicle.input == "rpm" else [1.0] * len(lagged)
    return [ops.sqrt(ops.fmax(t, STILL_N) * (1.0 / (p.k_f * g))) for t, g in zip(lagged, gain, strict=True)]


TERM = Term(
    name="thrust_rpm",
    sentence="Each rotor's thrust is k_f times its speed squared; with PWM inputs k_f only gives the speed of a rotor.",
    equation="T_i = k_f Omega_i^2",
    parameters=(Parameter("k_f", "N s^2/rad^2", 1e-11, 1e-4, 2.3e-8, neutral=None, systematic=NOTHING, in_product=True,
                          source="RotorPy crazyflie parameters 2.3e-8; Busetto et al. 2025 3.72e-8"),),
    acts={Stage.THRUST_MAP: thrust, Stage.ROTOR_SPEED: speed},
    input="rpm",
    confused_with={"mass": "a weighing: flight shows k_f / m only",
                   "thrust_scale": "a thrust stand: flight shows k_f s only"},
)

"""A rotor that speeds up turns the body against it.

Parameters
----------
J_r : float, kg m^2
    Moment of inertia of one rotor with its motor's bell, positive.

References
----------
Mahony, Kumar, Corke 2012, "Multirotor aerial vehicles: Modeling, estimation, and control of quadrotor", IEEE Robotics
& Automation Magazine 19(3), doi:10.1109/MRA.2012.2206474.
"""

from types import SimpleNamespace
from typing import Any

from .. import rotor
from ..ops import Ops
from ..systematic import NOTHING
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components, total
from .thrust_rpm import STILL_N

NEARLY_STILL = 0.02
"""Of the thrust of hover: a rotor that gives less starts or stops, and its speed would jump with its thrust."""


def moment(torque: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    if at.tau_s is None or not len(at.command_N):  # speeds that jump have no acceleration
        return list(torque)
    vehicle = at.vehicle
    least_N = NEARLY_STILL * vehicle.mass_kg * vehicle.gravity_m_s2 / vehicle.rotors
    slopes = rotor.derivative(at.lagged_N, at.command_N, *at.tau_s, ops)[1]
    # T = k_f Omega^2, hence dOmega/dt = Omega / (2 T) dT/dt
    faster = [0.5 * slope * omega / ops.sqrt(ops.fmax(thrust, STILL_N) * ops.fmax(thrust, least_N))
              for omega, slope, thrust in zip(at.rotor_rad_s, slopes, at.lagged_N, strict=True)]
    spin = total([s * rate for s, rate in zip(vehicle.spin, faster, strict=True)])
    return [torque[0], torque[1], torque[2] + p.J_r * spin]


TERM = Term(
    name="rotor_reaction",
    sentence="A rotor that speeds up turns the body the other way, the way its drag turns it: the yaw torque leads.",
    equation="tau_z <- tau_z + sum_i spin_i J_r dOmega_i/dt",
    parameters=(Parameter("J_r", "kg m^2", 0.0, 1e-2, 2e-8, systematic=NOTHING, grows="mll",
                          source="propeller and bell, 0.4 g at 7 mm radius of gyration"),),
    acts={Stage.TORQUE: moment},
    confused_with={"yaw_torque": "slow yaw: only drag acts there", "motor_lag": "roll and pitch, where nothing leads"},
    needs=("thrust_rpm",),
    not_asked="is separated from yaw torque only by logs faster than the motors (nanobench motors)",
)

"""The effects that can be concealed, by name: those of the vocabulary and the foreign ones.

Of terms from other packages: the injector they declare, or one made of their expressions (``of_term``).
"""

from nanobench_tools.physics.vocabulary import added

from .angular_damping import AngularDamping
from .com_offset import ComOffset
from .command_delay import CommandDelay
from .drag_linear import DragLinear
from .drag_quadratic import DragQuadratic
from .drag_rotor import DragRotor
from .drag_torque import DragTorque
from .dropout import Dropout
from .effect import SIZES, Air, Effect
from .force_world import ForceWorld
from .frame_tilt import FrameTilt
from .ground_effect import GroundEffect
from .gusts import Gusts
from .heating import Heating
from .inertia import Inertia
from .inflow import Inflow
from .jet import Jet
from .mass import Mass
from .motor_imbalance import MotorImbalance
from .motor_lag import MotorLag
from .of_term import effect_of
from .periodic_force import Periodic
from .rotor_gyro import RotorGyro
from .saturation import Saturation
from .tether import Tether
from .thrust_scale import ThrustScale
from .thrust_voltage import ThrustVoltage
from .wind import Wind
from .yaw_torque import YawTorque

EFFECTS: dict[str, type[Effect]] = {e.name: e for e in (
    ThrustVoltage, ThrustScale, Mass, MotorLag, CommandDelay, MotorImbalance, ComOffset, Inertia, YawTorque,
    AngularDamping, DragLinear, DragQuadratic, DragRotor, DragTorque, Inflow, GroundEffect, Wind, ForceWorld, FrameTilt,
    Saturation, RotorGyro, Jet, Heating, Periodic, Tether, Dropout, Gusts)}
EFFECTS |= {name: effect for name, term in added().items() if (effect := effect_of(term)) is not None}
KNOWN = tuple(name for name, e in EFFECTS.items() if not e.foreign)
FOREIGN = tuple(name for name, e in EFFECTS.items() if e.foreign)

__all__ = ["EFFECTS", "FOREIGN", "KNOWN", "SIZES", "Air", "Effect"]

"""The effects that can be concealed, by name: those of the vocabulary and the foreign ones.

Of terms from other packages: the injector they declare, or one made of their expressions (``of_term``).
"""

from nanobench_tools.physics.vocabulary import added

from . import air_effects as air
from .body_effects import ComOffset, FrameTilt, Inertia, Mass, RotorGyro, YawTorque
from .effect import SIZES, Air, Effect
from .foreign_effects import Dropout, Gusts, Heating, Jet, Periodic, Tether
from .motor_effects import CommandDelay, MotorImbalance, MotorLag, Saturation, ThrustScale, ThrustVoltage
from .of_term import effect_of

EFFECTS: dict[str, type[Effect]] = {e.name: e for e in (
    ThrustVoltage, ThrustScale, Mass, MotorLag, CommandDelay, MotorImbalance, ComOffset, Inertia, YawTorque,
    air.AngularDamping, air.DragLinear, air.DragQuadratic, air.DragRotor, air.DragTorque, air.Inflow, air.GroundEffect,
    air.Wind, air.ForceWorld, FrameTilt,
    Saturation, RotorGyro, Jet, Heating, Periodic, Tether, Dropout, Gusts)}
EFFECTS |= {name: effect for name, term in added().items() if (effect := effect_of(term)) is not None}
KNOWN = tuple(name for name, e in EFFECTS.items() if not e.foreign)
FOREIGN = tuple(name for name, e in EFFECTS.items() if e.foreign)

__all__ = ["EFFECTS", "FOREIGN", "KNOWN", "SIZES", "Air", "Effect"]

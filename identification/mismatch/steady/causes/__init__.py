"""Possible changes of a vehicle, one cause a file, in plain words. A new cause is a file and a line here."""

from . import battery, mass, other_vehicle, propeller, slung, tape, weight, wind
from .cause import Body, Cause, Hypothesis

CAUSES: dict[str, Cause] = {module.CAUSE.name: module.CAUSE for module in (
    propeller, weight, slung, tape, other_vehicle, wind, battery, mass)}

__all__ = ["CAUSES", "Body", "Cause", "Hypothesis"]

"""What may have been done to a vehicle, one cause a file, in a person's words; a new one is a file and a line here."""

from . import battery, mass, propeller, slung, tape, vehicle, weight, wind
from .base import Body, Cause, Hypothesis

CAUSES: dict[str, Cause] = {module.CAUSE.name: module.CAUSE for module in (
    propeller, weight, slung, tape, vehicle, wind, battery, mass)}

__all__ = ["CAUSES", "Body", "Cause", "Hypothesis"]

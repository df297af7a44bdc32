"""Wrong simulators on real flights: a nominal simulator gets one wrong belief, and a diagnosis has to find it.

A vehicle's nominal simulator is fitted to some of its flights, and groups of its other flights are diagnosed. The truth
of a case is the change back to the nominal simulator. Noise, clocks, gaps and disturbances are those of the flights.
"""

from .cases import CorruptedCase, cases_of
from .groups import Group, groups_of
from .vehicles import VEHICLES, VehicleSource

__all__ = ["VEHICLES", "CorruptedCase", "Group", "VehicleSource", "cases_of", "groups_of"]

"""Simulated practice flights through the whole logging chain, always labelled synthetic."""

from .flights import practice_flight, practice_flights, write_practice
from .flying import Flown, fly
from .logging_chain import PERFECT, LoggingChain
from .mocap import MocapNoise
from .onboard_crowd import CONTROLLERS
from .references import FAMILIES, PathSpec, path_spec

__all__ = ["CONTROLLERS", "FAMILIES", "PERFECT", "Flown", "LoggingChain", "MocapNoise", "PathSpec", "fly", "path_spec",
           "practice_flight", "practice_flights", "write_practice"]

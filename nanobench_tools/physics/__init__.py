"""Physics as terms: a model is a vehicle and a list of physical effects, each written down once.

``Model`` holds the terms and their flat parameter vector; The back ends: ``numeric`` evaluates it with NumPy,
``symbolic`` gives CasADi functions, ``ccode`` writes C. With ``rollout`` thousands of windows fly at once.
``simulator`` reads and writes simulator.toml; ``predictor`` enters a model into Task 1. A new effect is one file in
``terms`` and one line in setup.cfg.
"""

from .model import Model, find_term, neutral
from .vehicle import Vehicle

__all__ = ["Model", "Vehicle", "find_term", "neutral"]

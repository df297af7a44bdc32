"""nanobench: where was it, how would another controller fly, what physics does it obey, where is my simulator wrong.

``import nanobench_tools as nb``; nothing is loaded before its first use::

    flights = nb.load("flights/")            # list-like, a table as its repr
    nb.audit(flights[0]).verdict             # what is wrong with it, in one sentence
    nb.estimate(flights, "drag_ekf")         # where was it, against motion capture
    nb.fit(flights)                          # what physics does it obey
    nb.thrust(flights).thrust_N(0.7, 3.8)    # thrust of a motor from its command and the battery
    nb.diagnose(flights, "simulator.toml")   # where is my simulator wrong
"""

import importlib
from typing import Any

from .version import __version__

_PLACES = {
    "errors": ("InputError", "MissingExtraError", "NanobenchError", "UsageError"),
    "flight": ("Fault", "Flight", "Provenance", "Span", "Stream", "make_stream"),
    "methods": ("Controller", "Estimate", "Estimator", "Prediction", "Predictor", "Windows"),
    "api.loading": ("Flights", "load", "load_flight"),
    "api.audited": ("FlightAudit", "FlightAudits", "audit"),
    "api.estimated": ("Estimates", "compare", "estimate"),
    "api.fitted": ("VehicleModel", "fit"),
    "api.controlled": ("Tracking", "control"),
    "api.diagnosed": ("Diagnosis", "diagnose"),
    "api.practised": ("simulate",),
    "api.sampled": ("sample",),
    "api.thrusts": ("Thrust", "thrust"),
    "api.identified_motors": ("Motors", "motors"),
    "api.onboard_tuned": ("OnboardParameters", "tune_onboard"),
    "api.tuned": ("Tuning", "tune"),
    "api.proved": ("BlindProof", "prove"),
    "api.reported": ("report",),
}
"""Module -> the public names it holds."""
_MODULES = {name: module for module, names in _PLACES.items() for name in names}

__all__ = ["__version__", *_MODULES]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'nanobench_tools' has no attribute {name!r}")
    found = getattr(importlib.import_module(f".{_MODULES[name]}", __name__), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})

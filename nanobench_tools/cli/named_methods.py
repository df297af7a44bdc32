"""Methods by name: registered ones and ``module:Class``, checked before anything is run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..errors import UsageError
from ..methods import Controller, Estimator, Predictor
from ..registry import load

KINDS: dict[str, tuple[Any, tuple[str, ...]]] = {
    "estimators": (Estimator, ("name", "causal", "estimate(flight)")),
    "predictors": (Predictor, ("name", "information", "predict(windows)")),
         "controllers": (Controller, ("name", "information", "period_s", "reset(n)",
                                      "command(time_s, state, reference)"))}
"""Registry group -> what a method has to be, and its attributes for the message."""


def load_methods(group: str, names: Sequence[str]) -> list[Any]:
    """One instance per name, each once. UsageError for an unknown name, a class that cannot be made without arguments
    or that lacks an attribute, and two methods of the same name."""
    protocol, attributes = KINDS[group]
    found: dict[str, Estimator | Predictor | Controller] = {}
    for name in dict.fromkeys(names):
        kind = load(group, name)
        try:
            method = kind() if isinstance(kind, type) else kind
        except Exception as error:  # the class is anybody's code
            raise UsageError(f"{name}: making it raised {type(error).__name__}: {error}") from error
        if not isinstance(method, protocol):
            raise UsageError(f"{name}: is none of the {group}: it needs {', '.join(attributes)}")
        if method.name in found:
            raise UsageError(f"{name}: another method is called {method.name!r} too; rename one")
        found[str(method.name)] = method
    return list(found.values())

"""Methods by name: registered ones and ``module:Class``, checked before anything is run."""

from collections.abc import Sequence
from typing import Any

from ..errors import UsageError
from ..lookup.registry import load
from ..methods import Controller, Estimator, Predictor

KINDS: dict[str, tuple[Any, tuple[str, ...]]] = {
    "estimators": (Estimator, ("name", "causal", "estimate(flight)")),
    "predictors": (Predictor, ("name", "information", "predict(windows)")),
         "controllers": (Controller, ("name", "information", "period_s", "reset(n)",
                                      "command(time_s, state, reference)"))}
"""Registry group -> what a method has to be, and its attributes for the message."""


def as_methods(group: str, given: Any) -> list[Any]:
    """Methods of names, classes and objects, one or several; see ``load_methods``."""
    found = list(given) if isinstance(given, (list, tuple)) else [given]
    methods = [method for one in found for method in (
        load_methods(group, [one]) if isinstance(one, str) else [_checked(group, getattr(one, "__name__", str(one)),
                                                                         one)])]
    names = [method.name for method in methods]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise UsageError(f"two methods are called {twice!r}; rename one")
    return methods


def load_methods(group: str, names: Sequence[str]) -> list[Any]:
    """One instance per name, each once. UsageError for an unknown name, a class that cannot be made without arguments
    or that lacks an attribute, and two methods of the same name."""
    found: dict[str, Estimator | Predictor | Controller] = {}
    for name in dict.fromkeys(names):
        method = _checked(group, name, load(group, name))
        if method.name in found:
            raise UsageError(f"{name}: another method is called {method.name!r} too; rename one")
        found[str(method.name)] = method
    return list(found.values())


def _checked(group: str, name: str, kind: Any) -> Any:
    """An instance of ``kind``; UsageError where it cannot be made or is no method of ``group``."""
    protocol, attributes = KINDS[group]
    try:
        method = kind() if isinstance(kind, type) else kind
    except Exception as error:  # the class is anybody's code
        raise UsageError(f"{name}: making it raised {type(error).__name__}: {error}") from error
    if not isinstance(method, protocol):
        raise UsageError(f"{name}: is none of the {group}: it needs {', '.join(attributes)}")
    return method

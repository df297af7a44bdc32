"""Finds methods, sources and faults by entry point, so that a new one is one new file and one line.

Groups of ``nanobench``: estimators, controllers, predictors, sources, terms, faults, simulators.
``module:Class`` loads anything importable without registration.
"""

import functools
import warnings
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from ..errors import UsageError, unknown_name
from .user_folder import check_ours, load_module

GROUPS = ("estimators", "controllers", "predictors", "sources", "terms", "faults", "simulators")

OURS = ("nanobench_tools", "estimators", "controllers", "identification")


@functools.cache
def _entries(group: str) -> dict[str, EntryPoint]:
    if group not in GROUPS:
        raise KeyError(f"no registry group {group!r}; there are {', '.join(GROUPS)}")
    return {e.name: e for e in sorted(entry_points(group=f"nanobench.{group}"), key=lambda e: e.name)}


def names(group: str) -> list[str]:
    """Registered names of a group, sorted."""
    return list(_entries(group))


def added(group: str) -> list[str]:
    """Names of a group that other packages registered, sorted."""
    return [name for name, entry in _entries(group).items() if entry.module.partition(".")[0] not in OURS]


def load(group: str, name: str) -> Any:
    """The object registered as ``name``, or ``module:Class`` from the import path or the working directory. A user's
    ``controllers.pid:Pid`` works too, although we have ``controllers`` (``user_folder``)."""
    entries = _entries(group)
    if name in entries:
        check_ours(entries[name].module)
        return entries[name].load()
    if ":" not in name:
        raise UsageError(f"{unknown_name(group.removesuffix('s'), name, entries)}; or give module:Class")
    module, _, attribute = name.partition(":")
    try:
        found = functools.reduce(getattr, attribute.split("."), load_module(module))
    except ImportError as error:
        raise UsageError(f"{name}: {error}; run from the folder of the module or install it") from error
    except AttributeError as error:
        raise UsageError(f"{name}: {error}") from error
    except (Exception, SystemExit) as error:  # the module is the user's and may fail in any way while it is imported
        raise UsageError(f"{name}: importing it raised {type(error).__name__}: {error}") from error
    return found


def load_all(group: str) -> dict[str, Any]:
    """Everything registered; a plug-in that cannot be loaded is left out with a warning that names it."""
    found = {}
    for name, entry in _entries(group).items():
        try:
            found[name] = entry.load()
        except Exception as error:
            warnings.warn(f"{group} plug-in {name!r} ({entry.value}) left out: {type(error).__name__}: {error}",
                          stacklevel=2)
    return found

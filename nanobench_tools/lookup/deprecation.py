"""A former name works for one release, with a warning that gives the new word.

An option: one line of ``FORMER_OPTIONS``; a name behind an option: of ``FORMER_NAMES``. What a module has:
``__getattr__ = renamed(__name__, {"OLD": "package.module:new"})``; ``new()`` stands for a constant that is a function
today. The line goes with the release after the one that brought it (``version.py``).
"""

import importlib
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

FORMER_OPTIONS: dict[str, dict[str, str]] = {
    "audit": {"--details": "--verbose", "--no-details": "--no-verbose"},
    "control": {"--methods": "--learned"},
    "prove": {"--kinds": "--kind"},
    "simulate": {"--family": "--trajectory", "--duration": "--seconds", "--method": "--controller"},
    "sysid": {"--methods": "--learned", "--train-family": "--train-trajectory"}}
"""Verb -> {former spelling of an option: today's}."""

_TRAJECTORIES = {"figure8": "figure_eight", "battery_drain": "hover_until_landing"}
FORMER_NAMES: dict[str, dict[str, str]] = {
    "--trajectory": _TRAJECTORIES, "--judge": _TRAJECTORIES, "--learned": {"learned": "all"},
    "--controller": {"pid": "onboard_pid", "mellinger": "onboard_mellinger"}}
"""Current option of any verb -> {former name after it: current one}."""


def warn_renamed(former: str, today: str) -> None:
    """One line for whoever still uses ``former``. FutureWarning, since users, not authors alone, are to see it."""
    warnings.warn(f"{former} is called {today} now; the former name goes with the next release", FutureWarning,
                  stacklevel=3)


def todays_options(verb: str, words: Sequence[str]) -> list[str]:
    """Replaces former options and names among ``words`` of a command line (``--old 3`` or ``--old=3``). Each gives a
    warning. Words after ``--`` are not options."""
    former = FORMER_OPTIONS.get(verb, {})
    end = words.index("--") if "--" in words else len(words)
    found = list(words)
    for i, word in enumerate(words[:end]):
        option, equals, value = word.partition("=")
        if not equals and i + 1 < end:
            value = words[i + 1]
        today = former.get(option, option)
        name = FORMER_NAMES.get(today, {}).get(value, value)
        if name != value:
            warn_renamed(f"{option} {value}", f"{today} {name}")
            found[i:i + (1 if equals else 2)] = [f"{today}={name}"] if equals else [today, name]
        elif today != option:
            warn_renamed(option, today)
            found[i] = today + word.removeprefix(option)
    return found


def todays_name(option: str, name: str) -> str:
    """``name`` as it is called today where ``option`` takes it, and a warning for a former one."""
    today = FORMER_NAMES[option].get(name, name)
    if today != name:
        warn_renamed(name, today)
    return today


def renamed(module: str, names: Mapping[str, str]) -> Callable[[str], Any]:
    """A ``__getattr__`` for ``module``: former name -> ``module:name`` of today. A ``()`` behind it means that it is
    called."""
    def look_up(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        place, _, today = names[name].partition(":")
        warn_renamed(f"{module}.{name}", f"{place}.{today}")
        found = getattr(importlib.import_module(place), today.removesuffix("()"))
        return found() if today.endswith("()") else found

    return look_up

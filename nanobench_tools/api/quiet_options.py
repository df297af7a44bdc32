"""What the Python functions hand to the steps that the verbs are made of: options, nothing printed. And what comes back
as words of the command line, in Python's."""

import functools
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from ..errors import InputError, UsageError
from ..flight import Flight
from ..steps.options import Options, cores

FEW = 4
ARGUMENTS = {"data": "path", "mass": "mass_kg", "arm": "arm_m"}
"""Options whose argument in Python has another name."""
P = ParamSpec("P")
Found = TypeVar("Found")
_FUNCTIONS = "audit|estimate|thrust|motors|control|tune|diagnose|prove|simulate|report"
_COMMAND = re.compile(rf"nanobench (?!{_FUNCTIONS})[a-z]+[^);]*"  # has no function: stays a command
                      rf"|nanobench (?P<verb>{_FUNCTIONS})\b(?: --[a-z]+ [A-Z]+)*"
                      r"|(?<![\w-])--(?P<option>[a-z][a-z-]+)"
                      r"(?: (?P<value>retimed|offset|joint|[A-Z][A-Z_]*(?:\.\w+)?)\b)?")


def in_python(text: str) -> str:
    """Advice of the command line as Python: ``nanobench VERB`` becomes ``nb.VERB``, an option an argument.

    >>> in_python("try --clock retimed"), in_python("nanobench audit shows the faults")
    ('try clock="retimed"', 'nb.audit shows the faults')
    """
    def python(found: re.Match[str]) -> str:
        if found["verb"]:
            return f"nb.{found['verb']}"
        if not found["option"]:
            return found[0]
        name, value = ARGUMENTS.get(found["option"], found["option"].replace("-", "_")), found["value"]
        return name if value is None else f"{name}={value}" if value.isupper() else f'{name}="{value}"'

    return _COMMAND.sub(python, text)


def speaks_python(function: Callable[P, Found]) -> Callable[P, Found]:
    """The function, whose errors name arguments of Python where the steps below it name options."""
    @functools.wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> Found:
        try:
            return function(*args, **kwargs)
        except InputError as error:
            raise InputError(in_python(error.place), in_python(error.found), in_python(error.advice)) from error
        except UsageError as error:
            raise UsageError(in_python(str(error))) from error

    return called


def given(flights: Iterable[Flight] = (), **options: Any) -> Options:
    """Options of a verb that prints no output, with ``flights`` as its recordings. It uses all cores, but runs few
    flights in this process, which takes less time than starting others."""
    read = several(flights)
    return Options(**{"jobs": cores() if len(read) > FEW else 1, "quiet": True, **options, "flights": read})


def several(flights: Flight | Iterable[Flight]) -> list[Flight]:
    """One flight or many as a list with unique names. UsageError for anything else, and for none that is a flight."""
    found = [flights] if isinstance(flights, Flight) or not isinstance(flights, Iterable) else list(flights)
    strange = next((f for f in found if not isinstance(f, Flight)), None)
    if strange is not None:
        hint = "nb.load(path) reads flights" if isinstance(strange, (str, Path)) else "see Flight.from_pandas"
        raise UsageError(f"a {type(strange).__name__} is no Flight; {hint}")
    names = [f.name for f in found]
    twice = next((n for n in names if names.count(n) > 1), None)
    if twice is not None:
        raise UsageError(f"two flights are called {twice!r}; give each a different name (dataclasses.replace)")
    return found


def some(flights: Flight | Iterable[Flight]) -> list[Flight]:
    """``several``, at least one."""
    found = several(flights)
    if not found:
        raise UsageError("no flight given; nb.load(path) reads flights")
    return found

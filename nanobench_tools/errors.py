"""The errors a user may see. Each message is one line that names the place and says what to do."""

import difflib
import os
import sys
from collections.abc import Iterable
from pathlib import Path

DISTRIBUTION = "nanobench-tools"
"""What pip installs. The index's ``nanobench`` is somebody else's; the command is called ``nanobench`` all the same."""


def how_to_install(extra: str) -> str:
    """Return the command that installs an extra where nanobench is installed now, quoted for every shell.

    A checkout is installed by its path. A virtual environment that is not activated is named by its Python.
    """
    checkout = Path(__file__).resolve().parents[1]
    if not (checkout / "setup.cfg").is_file():
        return f'pip install "{DISTRIBUTION}[{extra}]"'
    activated = sys.prefix == sys.base_prefix or os.environ.get("VIRTUAL_ENV") == sys.prefix
    program = "pip" if activated else f"{_from_here(Path(sys.executable))} -m pip"
    return f'{program} install -e "{_from_here(checkout)}[{extra}]"'


def _from_here(path: Path) -> str:
    """``path`` relative to the working directory where it is inside it."""
    try:
        return str(path.relative_to(Path.cwd()))
    except (ValueError, OSError):
        return str(path)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """``did you mean 'clean'? `` for a name that is near a known one, else nothing.

    >>> did_you_mean("claen", ["clean", "aided"])
    "did you mean 'clean'? "
    """
    near = difflib.get_close_matches(name, list(known), n=1)
    return f"did you mean {near[0]!r}? " if near else ""


class NanobenchError(Exception):
    """Base of every error that bad input causes; the command line prints it as one line."""


class InputError(NanobenchError, ValueError):
    """A file, column, row or key is wrong.

    Parameters
    ----------
    place : str
        File, column, row, key.
    found : str
        The mistake that is there.
    advice : str
        What to do.

    Examples
    --------
    >>> str(InputError("flight.csv: column 'vbat', row 12", "text 'abc' where a number belongs", "mend the cell"))
    "flight.csv: column 'vbat', row 12: text 'abc' where a number belongs; mend the cell"
    """

    def __init__(self, place: str, found: str, advice: str = "") -> None:
        self.place, self.found, self.advice = str(place), found, advice
        text = f"{place}: {found}" + (f"; {advice}" if advice else "")
        super().__init__(" ".join(text.split()))

    def __reduce__(self) -> tuple[type, tuple[str, ...]]:  # for process pools; the default loses two arguments
        return type(self), (self.place, self.found, self.advice)


class UsageError(NanobenchError, ValueError):
    """An option or a name that does not exist, or two that do not go together."""


class MissingExtraError(NanobenchError, ImportError):
    """An optional package is not installed; the message has the command that installs it.

    Parameters
    ----------
    package : str
        The missing package.
    extra : str
        The extra of ``nanobench-tools`` that contains it.
    """

    def __init__(self, package: str, extra: str) -> None:
        self.package, self.extra = package, extra
        super().__init__(f"{package} is not installed; {how_to_install(extra)}")

    def __reduce__(self) -> tuple[type, tuple[str, ...]]:
        return type(self), (self.package, self.extra)


def unknown_name(what: str, name: str, known: Iterable[str]) -> UsageError:
    """The error for a name that does not exist: the nearest known one, and all there are.

    >>> str(unknown_name("protocol", "claen", ["clean", "aided"]))
    "unknown protocol 'claen'; did you mean 'clean'? known: clean, aided"
    """
    there = list(known)
    return UsageError(f"unknown {what} {name!r}; {did_you_mean(name, there)}known: {', '.join(there) or 'none'}")

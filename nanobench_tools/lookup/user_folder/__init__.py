"""A user's package that has the name of one of ours (``controllers``, ``estimators``, ``identification``).

Python knows one module of a name. So the modules of a folder with such a package are loaded under another name. For
``controllers.pid`` it is ``nanobench_tools.lookup.user_folder.in_XYZ.controllers.pid``, where XYZ is the coded path of
the folder. The name gives the place, so another process can import what was sent to it. In these modules ``from
controllers.gains import Gains`` means the user's file: each has an ``__import__`` that looks into the folder first.
``importlib.import_module`` with an absolute name does not use it and finds ours.
"""

import base64
import builtins
import importlib
import importlib.util
import os
import sys
import sysconfig
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

from ...errors import UsageError

OURS = ("controllers", "estimators", "identification")
"""Our top-level packages whose names a user may well choose, too."""
ROOT = Path(__file__).resolve().parents[3]
"""The folder of our packages: a checkout, or where they were installed."""
PREFIX = f"{__name__}.in_"
INSTALLED = {Path(sysconfig.get_path(key)).resolve() for key in ("stdlib", "purelib", "platlib")}


def ours_first() -> None:
    """From here on ``import controllers`` is ours: folders with a package of that name move behind our folder. This
    also applies to processes that inherit the import path."""
    theirs = [place for place in sys.path if _has_ours(Path(place or os.curdir).resolve())]
    if theirs:
        sys.path[:] = [*(place for place in sys.path if place not in theirs), str(ROOT), *theirs]


def check_ours(module: str) -> None:
    """UsageError where ``module`` is of one of our packages and Python takes somebody else's for it."""
    top = module.partition(".")[0]
    found = importlib.util.find_spec(top) if top in OURS else None
    if found is not None and not _is_ours(found, top):
        place = found.origin or next(iter(found.submodule_search_locations or ()), "another")
        raise UsageError(f"{module}: package {top!r} is {place} in this process and not nanobench's; rename your "
                         "package, or use the command nanobench, which keeps the two apart")


def load_module(name: str) -> ModuleType:
    """The module ``name`` from the import path or the working directory; a user's before one of ours. Raises what
    importing it raises."""
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    importlib.invalidate_caches()
    places = dict.fromkeys(Path(place or os.curdir).resolve() for place in sys.path)
    folder = next((p for p in places if p not in INSTALLED and _has_ours(p) and find_in(p, name)), None)
    return importlib.import_module(name if folder is None else f"{_name_of(folder)}.{name}")


def own_name(module: str) -> tuple[Path, str] | None:
    """(folder, name its user knows) of a module that was loaded under another name; None for any other."""
    if not module.startswith(PREFIX):
        return None
    coded, _, name = module.removeprefix(PREFIX).partition(".")
    return Path(os.fsdecode(base64.b32decode(coded.upper() + "=" * (-len(coded) % 8)))), name


def find_in(folder: Path, name: str) -> ModuleSpec | None:
    """The top-level module or package of ``name`` where ``import name`` in a module of ``folder`` means one there."""
    top, _, rest = name.partition(".")
    there = PathFinder.find_spec(top, [str(folder)])
    if there is None or top in sys.stdlib_module_names or _is_ours(there, top):
        return None
    if top in OURS:  # a plain folder without modules only has the name
        first = rest.partition(".")[0]
        wanted = (f"{first}.py", f"{first}/*.py") if first else ("*.py",)
        return there if there.loader or any(f for p in _places(there) for w in wanted for f in p.glob(w)) else None
    try:
        usual = importlib.util.find_spec(top)  # in the order of the path: the folder's yaml.py hides no installed one
    except (ImportError, ValueError):
        return None
    return there if usual is None or _places(usual) & _places(there) else None


def _has_ours(folder: Path) -> bool:
    return any(find_in(folder, name) for name in OURS)


def _is_ours(spec: ModuleSpec, name: str) -> bool:
    return spec.origin is not None and Path(spec.origin).resolve().is_relative_to(ROOT / name)


def _places(spec: ModuleSpec) -> set[Path]:
    found = [*(spec.submodule_search_locations or ()), *([spec.origin] if spec.has_location and spec.origin else ())]
    return {Path(place).resolve() for place in found}


def _name_of(folder: Path) -> str:
    return PREFIX + base64.b32encode(os.fsencode(folder)).decode().rstrip("=").lower()


class _Loader(SourceFileLoader):
    """Runs a module whose import statements look into its folder first."""

    def exec_module(self, module: ModuleType) -> None:
        named = own_name(module.__name__)
        assert named is not None
        folder = named[0]

        def look_up(name: str, globals: Any = None, locals: Any = None, fromlist: Any = (),
                    level: int = 0) -> ModuleType:
            if level or not find_in(folder, name):
                return builtins.__import__(name, globals, locals, fromlist, level)
            found = builtins.__import__(f"{_name_of(folder)}.{name}", globals, locals, fromlist, 0)
            return found if fromlist else sys.modules[f"{_name_of(folder)}.{name.partition('.')[0]}"]

        vars(module)["__builtins__"] = {**vars(builtins), "__import__": look_up}
        super().exec_module(module)


class _Finder:
    """Finds folders by the path in their name, and their modules."""

    @classmethod
    def find_spec(cls, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
                  ) -> ModuleSpec | None:
        if (named := own_name(name)) is None:
            return None
        if not named[1]:
            spec = ModuleSpec(name, None, is_package=True)
            spec.submodule_search_locations = [str(named[0])]
            return spec
        found = PathFinder.find_spec(name, path)
        if found is not None and isinstance(found.loader, SourceFileLoader):
            found.loader = _Loader(name, found.loader.path)
        return found


if _Finder not in sys.meta_path:
    sys.meta_path.insert(0, _Finder)

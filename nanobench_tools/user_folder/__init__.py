"""A user's package that has the name of one of ours (``controllers``, ``estimators``, ``identification``).

Python knows one module of a name. So a folder with such a package is loaded under a name of its own: its
``controllers.pid`` becomes ``nanobench_tools.user_folder.in_XYZ.controllers.pid``, XYZ being the path of the folder.
Relative imports stay in the folder by themselves. Absolute ones (``from controllers.gains import Gains``) are looked
up in the folder too, in its modules alone: each gets an ``__import__`` of its own; ``importlib.import_module`` with
an absolute name is not seen and finds ours. The name says where to look, so that
another process can import what was sent to it.

In a process of ours ``keep_ours`` takes the names for our packages, whatever stands first on the path.
"""

from __future__ import annotations

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

from ..errors import UsageError

OURS = ("controllers", "estimators", "identification")
"""Our top-level packages whose names a user may well choose, too."""
ROOT = Path(__file__).resolve().parents[2]
"""The folder they stand in: a checkout, or where they were installed."""
PREFIX = f"{__name__}.in_"
_INSTALLED = {Path(sysconfig.get_path(key)).resolve() for key in ("stdlib", "purelib", "platlib")}


def keep_ours() -> None:
    """From here on ``import controllers`` is ours in this process. UsageError where it is somebody else's already."""
    for name in OURS:
        where = ROOT / name / "__init__.py"
        if name not in sys.modules and where.is_file():
            spec = importlib.util.spec_from_file_location(name, where)
            assert spec is not None
            assert spec.loader is not None
            sys.modules[name] = module = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(module)
        check_ours(name)


def are_ours() -> bool:
    """Whether ``keep_ours`` did its work here, or our packages were simply the first."""
    specs = {name: sys.modules[name].__spec__ for name in OURS if name in sys.modules}
    return len(specs) == len(OURS) and all(spec is not None and _is_ours(spec, name) for name, spec in specs.items())


def check_ours(module: str) -> None:
    """UsageError where ``module`` is of one of our packages and Python takes somebody else's for it."""
    top = module.partition(".")[0]
    found = importlib.util.find_spec(top) if top in OURS else None
    if found is not None and not _is_ours(found, top):
        place = found.origin or next(iter(found.submodule_search_locations or ()), "another")
        raise UsageError(f"{module}: package {top!r} is {place} in this process and not nanobench's; the command "
                         "nanobench keeps the two apart, a script of your own has to rename its package")


def load_module(name: str) -> ModuleType:
    """The module ``name`` from the import path or the working directory; a user's before one of ours. Raises what
    importing it raises."""
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    importlib.invalidate_caches()
    folder = _folder_of(name)
    return importlib.import_module(name if folder is None else f"{_name_of(folder)}.{name}")


def own_name(module: str) -> tuple[Path, str] | None:
    """(folder, name its user knows) of a module that was loaded under a name of its own; None for any other."""
    if not module.startswith(PREFIX):
        return None
    coded, _, name = module.removeprefix(PREFIX).partition(".")
    return _folder_named(coded), name


def find_in(folder: Path, top: str) -> ModuleSpec | None:
    """Where top-level ``top`` is for the modules of ``folder``; None when not in the folder."""
    if top in OURS:
        return PathFinder.find_spec(top, [str(folder)])
    try:
        spec = importlib.util.find_spec(top)  # in the order of the path: the folder's yaml.py hides no installed one
    except (ImportError, ValueError):
        return None
    if spec is None:
        return PathFinder.find_spec(top, [str(folder)])
    places = [*(spec.submodule_search_locations or ()), *([spec.origin] if spec.has_location and spec.origin else ())]
    return PathFinder.find_spec(top, [str(folder)]) if any(
        Path(place).resolve().parent in (folder, folder / top) for place in places) else None


def _is_ours(spec: ModuleSpec, name: str) -> bool:
    return spec.origin is not None and Path(spec.origin).resolve().is_relative_to(ROOT / name)


def _folder_of(name: str) -> Path | None:
    """The folder on the import path that holds module ``name`` and a package named like one of ours."""
    top, _, rest = name.partition(".")
    for place in [*dict.fromkeys(Path(entry or os.curdir).resolve() for entry in sys.path)]:
        if place in (ROOT, *_INSTALLED) or not place.is_dir() or not any(_holds(place, ours) for ours in OURS):
            continue
        if _holds(place, top, rest) if top in OURS else find_in(place, top):
            return place
    return None


def _holds(folder: Path, top: str, rest: str = "") -> bool:
    """Whether ``top`` stands in ``folder``: a module, a package, or a plain folder that holds ``rest`` (any module)."""
    spec = PathFinder.find_spec(top, [str(folder)])
    if spec is None or _is_ours(spec, top):
        return False
    if spec.loader is not None:
        return True
    places = [Path(place) for place in spec.submodule_search_locations or ()]
    first = rest.partition(".")[0]
    return any((place / f"{first}.py").is_file() or (place / first).is_dir() if first else any(place.glob("*.py"))
               for place in places)


def _name_of(folder: Path) -> str:
    return PREFIX + base64.b32encode(os.fsencode(folder)).decode().rstrip("=").lower()


def _folder_named(coded: str) -> Path:
    return Path(os.fsdecode(base64.b32decode(coded.upper() + "=" * (-len(coded) % 8))))


class _Loader(SourceFileLoader):
    """Runs a module whose import statements look into its folder first."""

    def exec_module(self, module: ModuleType) -> None:
        named = own_name(module.__name__)
        assert named is not None
        folder = named[0]

        def look_up(name: str, globals: Any = None, locals: Any = None, fromlist: Any = (),
                    level: int = 0) -> ModuleType:
            top = name.partition(".")[0]
            if level or top in sys.stdlib_module_names or find_in(folder, top) is None:
                return builtins.__import__(name, globals, locals, fromlist, level)
            found = builtins.__import__(f"{_name_of(folder)}.{name}", globals, locals, fromlist, 0)
            return found if fromlist else sys.modules[f"{_name_of(folder)}.{top}"]  # "import a.b" binds a

        vars(module)["__builtins__"] = {**vars(builtins), "__import__": look_up}
        super().exec_module(module)


class _Finder:
    """Finds folders by the path in their name, and what they hold."""

    @classmethod
    def find_spec(cls, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
                  ) -> ModuleSpec | None:
        named = own_name(name)
        if named is None:
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

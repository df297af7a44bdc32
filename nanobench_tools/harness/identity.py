"""Keys of items: everything that a result depends on, as one hash, so that the store never answers for changed inputs.

A key covers the function, its arguments, the content of the inputs and the methods (own source for one from outside).
It also covers the source of this package and the versions of the numerical libraries.
"""

import ast
import dataclasses
import functools
import hashlib
import importlib.util
import os
import pickle
import struct
import sys
import types
import uuid
from collections.abc import Callable, Iterable, Mapping
from importlib import metadata
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

import numpy as np

from ..lookup import user_folder
from ..version import __version__

PACKAGES = ("nanobench_tools", "estimators", "controllers", "identification")
"""The packages of this distribution."""


def sha256_of(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


@functools.cache
def package_hash() -> str:
    """Hash of version, Python, numerical libraries and every source and data file of the installed packages."""
    digest = hashlib.sha256(f"{__version__} {sys.version_info[:2]}".encode())
    for library in ("numpy", "scipy"):
        digest.update(f"{library}=={metadata.version(library)}".encode())
    root = Path(__file__).resolve().parents[2]
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                digest.update(path.relative_to(root).as_posix().encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()


def method_identity(method: Any) -> str:
    """Qualified name, ``version`` attribute and, from outside this package, the source it is made of.

    ``method`` is a class, a function or an instance (whose attributes count too). A method from outside includes
    everything that it imports. One without a file (typed at a prompt) gets a new name each time, so that the store
    never answers for it. A file that a method reads itself does not count: raise its ``version`` then.
    """
    kind = method if isinstance(method, (type, types.FunctionType, types.BuiltinFunctionType)) else type(method)
    theirs = user_folder.own_name(kind.__module__)
    text = f"{theirs[1] if theirs else kind.__module__}:{kind.__qualname__} {getattr(method, 'version', '')}"
    if theirs or kind.__module__.partition(".")[0] not in PACKAGES:
        text += f" {_source_hash(kind.__module__)}"
    if kind is not method:
        text += f" {_hash(vars(method)) if hasattr(method, '__dict__') else sha256_of(pickle.dumps(method))}"
    elif closure := getattr(method, "__closure__", None):
        text += f" {_hash([cell.cell_contents for cell in closure])}"
    return text


def item_key(function: Callable[..., Any], kwargs: Mapping[str, Any], inputs: Iterable[str] = ()) -> str:
    """The key of one item (64 hex digits): ``inputs`` are content hashes of files that ``kwargs`` only names.

    Arguments count by content: numbers, text, arrays, dataclasses (a Flight too), classes and objects by
    ``method_identity``.
    """
    digest = hashlib.sha256(package_hash().encode())
    digest.update(method_identity(function).encode())
    digest.update(_hash(dict(kwargs)).encode())
    digest.update("\0".join(inputs).encode())
    return digest.hexdigest()


def _hash(value: Any) -> str:
    digest = hashlib.sha256()
    _feed(digest, value)
    return digest.hexdigest()


def _feed(digest: Any, value: Any) -> None:
    """Feeds ``value`` with its type and length, so that ("ab", "c") and ("a", "bc") differ."""
    if value is None or isinstance(value, (bool, int, str, os.PathLike)):
        text = repr(os.fspath(value) if isinstance(value, os.PathLike) else value).encode()
        digest.update(struct.pack("<cq", b"t", len(text)) + text)
    elif isinstance(value, float):
        digest.update(b"f" + struct.pack("<d", value))
    elif isinstance(value, bytes):
        digest.update(struct.pack("<cq", b"b", len(value)) + value)
    elif isinstance(value, np.ndarray) and value.dtype != object:
        digest.update(f"a{value.dtype.str}{value.shape}".encode() + np.ascontiguousarray(value).tobytes())
    elif isinstance(value, np.generic):
        _feed(digest, value.item())
    elif isinstance(value, Mapping):
        digest.update(struct.pack("<cq", b"m", len(value)))
        for key in sorted(value, key=repr):
            _feed(digest, key)
            _feed(digest, value[key])
    elif isinstance(value, (list, tuple, np.ndarray)):
        digest.update(struct.pack("<cq", b"l", len(value)))
        for item in value:
            _feed(digest, item)
    elif isinstance(value, (set, frozenset)):
        _feed(digest, ["set", *sorted(_hash(item) for item in value)])
    elif isinstance(value, functools.partial):
        _feed(digest, ["partial", value.func, value.args, value.keywords])
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        _feed(digest, [method_identity(type(value)), fields])
    else:
        _feed(digest, method_identity(value))


@functools.cache
def _source_hash(module_name: str) -> str:
    """Hash of an outside method: its module or package, and the modules from the same place that it imports anywhere
    in its text. Includes names and versions of all installed distributions."""
    module_file = getattr(sys.modules.get(module_name), "__file__", None)
    if not module_file:
        return uuid.uuid4().hex
    digest = hashlib.sha256("\0".join(_distributions()).encode())
    seen: set[str] = set()
    folder, name = user_folder.own_name(module_name) or (None, module_name)
    queue = [name.partition(".")[0]]
    while queue:
        name = queue.pop()
        inside = folder and user_folder.find_in(folder, name)
        if name in seen or (name in PACKAGES and not inside) or name in sys.stdlib_module_names:
            continue
        seen.add(name)
        own = len(seen) == 1
        for path in _files_of(name, own, inside or None) or ([Path(module_file)] if own else []):
            digest.update(path.name.encode())
            if path.suffix == ".py":
                text = path.read_bytes()
                digest.update(text)
                queue += sorted(_imported(text), reverse=True)
            else:  # data next to the source: size and date, it may be large
                digest.update(repr((path.stat().st_size, path.stat().st_mtime_ns)).encode())
    return digest.hexdigest()


INSTALLED = {"site-packages", "dist-packages"}
"""Folders of installed packages, of this environment and of those it builds on."""


def _files_of(name: str, installed_too: bool, spec: ModuleSpec | None) -> list[Path]:
    """The file of a top-level module or all files of a package; none for what was installed, unless asked. ``spec``:
    where it is, if known."""
    try:
        spec = spec or importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return []
    places = [*(spec.submodule_search_locations or [])] if spec else []
    found = [Path(place) for place in places or ([spec.origin] if spec and spec.has_location and spec.origin else [])]
    if not installed_too and any(INSTALLED & set(path.parts) for path in found):
        return []
    return [file for path in found for file in (sorted(path.rglob("*")) if path.is_dir() else [path])
            if file.is_file() and "__pycache__" not in file.parts]


def _imported(text: bytes) -> set[str]:
    """Top-level names of everything a source imports, also inside functions."""
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError):
        return set()
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module)
    return {name.partition(".")[0] for name in names}


@functools.cache
def _distributions() -> list[str]:
    """Folder names (distribution and version) of everything installed."""
    return sorted(path.name for place in {*sys.path} if place for path in Path(place).glob("*.dist-info"))

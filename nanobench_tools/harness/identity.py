"""Keys of items: what a result depends on, as one hash, so that nothing changed is ever answered from the store.

A key covers the function, its arguments, the content of the inputs, the methods (own source for one from outside),
the source of this package and the versions of the numerical libraries.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import inspect
import os
import pickle
import struct
import sys
import sysconfig
import types
import uuid
from collections.abc import Callable, Iterable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

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

    ``method`` is a class, a function or an instance (whose attributes count too). The source of an outside method is
    its module's file and those of the modules it uses, installed libraries left out; one without a file (typed at a
    prompt) gets a name of its own each time, so that it is never answered from the store.
    """
    kind = method if isinstance(method, (type, types.FunctionType, types.BuiltinFunctionType)) else type(method)
    text = f"{kind.__module__}:{kind.__qualname__} {getattr(method, 'version', '')}"
    if kind.__module__.partition(".")[0] not in PACKAGES:
        text += f" {_source_hash(kind.__module__)}"
    if kind is not method:
        text += f" {_hash(vars(method)) if hasattr(method, '__dict__') else sha256_of(pickle.dumps(method))}"
    elif getattr(method, "__closure__", None):
        text += f" {_hash([cell.cell_contents for cell in method.__closure__])}"
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


def _feed(digest, value: Any) -> None:
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
    """Hash of the files of ``module_name`` and of what it uses outside the standard library and installed packages."""
    module = sys.modules.get(module_name)
    if module is None or not getattr(module, "__file__", None):
        return uuid.uuid4().hex
    digest, seen, queue = hashlib.sha256(), set(), [module]
    while queue:
        current = queue.pop()
        file = getattr(current, "__file__", None)
        if current.__name__ in seen or not file:
            continue
        seen.add(current.__name__)
        if current is not module and not _is_own(current, module):
            continue
        digest.update(Path(file).read_bytes())
        used = {getattr(value, "__module__", None) for value in vars(current).values()}
        names = {name for name in used if isinstance(name, str)}
        names |= {value.__name__ for value in vars(current).values() if inspect.ismodule(value)}
        queue += [sys.modules[name] for name in sorted(names - seen, reverse=True) if name in sys.modules]
    return digest.hexdigest()


def _is_own(module: types.ModuleType, method_module: types.ModuleType) -> bool:
    """Whether ``module`` belongs to the method: same package, or not a part of Python, an installed library or us."""
    top = module.__name__.partition(".")[0]
    if top in PACKAGES:
        return False
    if top == method_module.__name__.partition(".")[0]:
        return True
    places = {sysconfig.get_paths()[key] for key in ("stdlib", "platstdlib", "purelib", "platlib")}
    return not any(Path(module.__file__ or "").is_relative_to(place) for place in places)

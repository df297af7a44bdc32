"""LLVM text -> machine code of this processor, kept in the user's cache folder under the hash of all it depends on.

Entries are object files that only this user can have written (folder mode 0700, own files). An incomplete one fails
its checksum and is made again.
"""

import ctypes
import functools
import hashlib
import os
import stat
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..results.cache_folder import cache_folder

_LOCK = threading.Lock()
_ENGINES: list[Any] = []
"""Own the machine code, which has to outlive every kernel that was handed out."""
_LIBRARY_FUNCTIONS = ("exp", "log", "sin", "cos", "tan", "pow", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh",
                      "erf", "fmod", "hypot", "expm1", "log1p", "floor", "ceil")
CODE_MODEL = "large"
"""Code and constants may land anywhere: libraries that map much memory leave no two places within 2 GB."""
_LONG = 40000
"""Lines of code above which the compiler makes less effort: its time grows faster than the code."""


@functools.cache
def _target() -> tuple[Any, Any, str, str]:
    """LLVM's binding and the description of this processor."""
    from llvmlite import binding as llvm

    for initialise in (llvm.initialize_native_target, llvm.initialize_native_asmprinter):
        initialise()
    library = ctypes.CDLL(None)
    for name in _LIBRARY_FUNCTIONS:
        llvm.add_symbol(name, ctypes.cast(getattr(library, name), ctypes.c_void_p).value)
    return llvm, llvm.Target.from_default_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def _folder() -> Path | None:
    """Where object files are kept, or None if nobody but this user can be kept out."""
    folder = cache_folder() / "kernels"
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        found = folder.stat()
    except OSError:
        return None
    safe = found.st_uid == os.getuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return folder if safe else None


def _read(entry: Path) -> bytes | None:
    try:
        data = entry.read_bytes()
        if entry.stat().st_uid != os.getuid():
            return None
    except OSError:
        return None
    return data[32:] if hashlib.sha256(data[32:]).digest() == data[:32] else None


def _write(entry: Path, code: bytes) -> None:
    part = entry.with_name(f"{entry.name}.{os.getpid()}.{threading.get_ident()}")
    try:
        part.write_bytes(hashlib.sha256(code).digest() + code)
        part.replace(entry)
    except OSError:  # a full disk only costs the next compilation
        part.unlink(missing_ok=True)


def effort(text: str) -> int:
    """Level of LLVM's optimisation for a module, 0 to 2."""
    return 2 if text.count("\n") < _LONG else 1


def object_code(text: str) -> bytes:
    """Object file of an LLVM module, from the cache or compiled now."""
    llvm, target, cpu, features = _target()
    level = effort(text)
    about = "\0".join([text, cpu, features, CODE_MODEL, str(level), str(llvm.llvm_version_info)])
    folder = _folder()
    entry = folder / f"{hashlib.sha256(about.encode()).hexdigest()}.o" if folder else None
    code = _read(entry) if entry else None
    if code is None:
        module = llvm.parse_assembly(text)
        module.verify()
        code = target.create_target_machine(cpu=cpu, features=features, opt=level, reloc="pic",
                                            codemodel=CODE_MODEL).emit_object(module)
        if entry:
            _write(entry, code)
    return code


@functools.cache
def load(text: str, pointers: int) -> Callable[..., None]:
    """Callable kernel of a module: ``pointers`` array addresses, then five integers (see ``lanes.Kernel``)."""
    llvm, target, cpu, features = _target()
    with _LOCK:
        code = object_code(text)
        machine = target.create_target_machine(cpu=cpu, features=features, opt=0, reloc="pic", codemodel=CODE_MODEL)
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        engine.finalize_object()
        address = engine.get_function_address("kernel")
    call = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * pointers, *[ctypes.c_int64] * 5)(address)
    _ENGINES.append(engine)
    return call

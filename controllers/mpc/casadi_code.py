"""CasADi functions called without copies, as C where a C compiler is at hand.

The shared object is cached under the hash of its source and of the compiler's options. Without a compiler, CasADi's
own machine evaluates the same function, a few times slower.
"""

import contextlib
import hashlib
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from nanobench_tools.errors import MissingExtraError
from nanobench_tools.results.cache_folder import cache_folder

OPTIONS = ("-O1", "-fPIC", "-shared", "-fno-math-errno")
COMPILERS = ("gcc", "cc", "clang")
LONGEST_S = 300.0
"""A compiler that takes longer is given up."""


class SolverFailure(ArithmeticError):
    """A solver, or a compiled function, gives no answer and says so."""


def import_casadi() -> Any:
    """The module casadi; raises MissingExtraError when the extra is not installed."""
    try:
        import casadi
    except ImportError:
        raise MissingExtraError("casadi", "mpc") from None
    return casadi


def compiler() -> str | None:
    """The first C compiler found; $NANOBENCH_CC names another, or none when it is empty."""
    named = os.environ.get("NANOBENCH_CC")
    if named is not None:
        return shutil.which(named) if named else None
    return next((found for name in COMPILERS if (found := shutil.which(name))), None)


def compiled(function: Any) -> tuple[Any, bool]:
    """casadi.Function -> the same as compiled C and True, or as it is and False where that is not possible."""
    cc = compiler()
    if cc is None:
        return function, False
    ca = import_casadi()
    with tempfile.TemporaryDirectory() as scratch:
        generator = ca.CodeGenerator("code.c")
        generator.add(function)
        generator.generate(f"{scratch}/")
        source = Path(scratch) / "code.c"
        key = hashlib.sha256(source.read_bytes() + " ".join((cc, *OPTIONS)).encode()).hexdigest()[:32]
        kept = cache_folder() / "compiled" / f"{key}.so"
        if not kept.exists() and not _build(cc, source, kept):
            return function, False
    try:
        return ca.external(function.name(), str(kept)), True
    except RuntimeError:  # made by another machine, or broken
        return function, False


def _build(cc: str, source: Path, kept: Path) -> bool:
    made = source.with_suffix(".so")
    try:
        subprocess.run([cc, *OPTIONS, str(source), "-o", str(made), "-lm"], check=True, capture_output=True,
                       timeout=LONGEST_S)
        kept.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=kept.parent)
        os.close(handle)
        shutil.copyfile(made, name)
        os.replace(name, kept)
    except (OSError, subprocess.SubprocessError):
        with contextlib.suppress(OSError, UnboundLocalError):
            os.unlink(name)
        return False
    return True


class Call:
    """A casadi.Function with dense arguments on fixed arrays: write ``given[i]``, call, read ``found[i]``.

    Arrays are column by column as in CasADi: a matrix (r, c) appears as (c, r). ``is_c`` says whether C runs.
    """

    def __init__(self, function: Any) -> None:
        self.function, self.is_c = compiled(function)
        self.given = [np.zeros(function.size_in(i)[::-1]) for i in range(function.n_in())]
        self.found = [np.zeros(function.size_out(i)[::-1]) for i in range(function.n_out())]
        self._buffer, self._run = self.function.buffer()
        for i, array in enumerate(self.given):
            self._buffer.set_arg(i, array.data)
        for i, array in enumerate(self.found):
            self._buffer.set_res(i, array.data)

    def __call__(self) -> list[np.ndarray]:
        """Raises SolverFailure when the function says that it failed."""
        self._run()
        if self._buffer.ret():
            raise SolverFailure(f"{self.function.name()} failed")
        return self.found

"""Any CasADi SX function, compiled to run over thousands of windows at once, alone or row after row.

Lanes (windows) come last in every array: (components, n). Matrices are (rows, columns, n). All other modules see this
file only (``lanes`` writes LLVM code, ``machine`` compiles and caches it).
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from ..errors import InputError
from . import machine
from .lanes import LANES, Kernel, kernel

__all__ = ["LANES", "Compiled", "batched", "scan"]


def _padded(n: int) -> int:
    return -(-n // LANES) * LANES


def _lanes(array: np.ndarray, name: str, n: int, shape: tuple[int, int], by_row: bool) -> np.ndarray:
    """An input as contiguous (rows of data, components, N); lanes that fill the last block repeat the first."""
    array = np.asarray(array, float)
    height, width = shape
    wanted = (height, n) if width == 1 else (height, width, n)
    if array.shape[int(by_row):] != wanted:
        raise InputError(f"input {name}", f"shape {array.shape}", f"give {('rows, ' if by_row else '') + str(wanted)}")
    array = array if by_row else array[None]
    if width != 1:  # CasADi counts down the columns
        array = np.swapaxes(array, 1, 2).reshape(len(array), height * width, n)
    if n % LANES == 0:
        return np.ascontiguousarray(array)
    wide = np.concatenate([array, np.repeat(array[..., :1], _padded(n) - n, axis=-1)], axis=-1)
    return np.ascontiguousarray(wide)  # arrays that run down their columns are joined to one that does


def _uniform(array: np.ndarray, name: str, shape: tuple[int, int]) -> np.ndarray:
    array = np.asarray(array, float)
    if array.size != shape[0] * shape[1]:
        raise InputError(f"input {name}", f"shape {array.shape}", f"give {shape[0] * shape[1]} numbers")
    return np.ascontiguousarray(array.reshape(-1, order="F"))


class Compiled:
    """Machine code of a casadi.Function. ``roles`` of its inputs: ``lane`` (a separate value for every window) or
    ``uniform`` (one for all). A ``row`` input has a separate value for every window and row. The first may be
    ``state``.
    """

    def __init__(self, function: Any, roles: Sequence[str], threads: int = 1) -> None:
        self.kernel: Kernel = kernel(function, roles)
        self.names = tuple(function.name_in(i) for i in range(function.n_in()))
        self.threads = threads
        self._call = machine.load(self.kernel.text, len(self.kernel.inputs) + len(self.kernel.outputs))

    def __call__(self, *inputs: np.ndarray, keep: str = "all") -> tuple[np.ndarray, ...]:
        """Outputs of the function, windows last.

        Without ``row`` inputs and state: arrays (components, n) -> outputs (rows, columns, n), (rows, n) of vectors.
        With ``row`` inputs (H, components, n): outputs get a first axis of H rows. With a state (S, n), the first
        output has the start and the states after each row, (H + 1, S, n). With ``keep="last"`` it has only the last
        one (S, n).
        """
        roles = self.kernel.roles
        if len(inputs) != len(roles):
            raise InputError("compiled function", f"{len(inputs)} inputs", f"give {', '.join(self.names)}")
        counts = {(np.shape(x) or (0,))[-1] for x, role in zip(inputs, roles, strict=True) if role != "uniform"}
        rows = {(np.shape(x) or (0,))[0] for x, role in zip(inputs, roles, strict=True) if role == "row"}
        if len(counts) != 1 or len(rows) > 1:
            raise InputError("compiled function", f"inputs for {sorted(counts)} windows and {sorted(rows)} rows",
                             "give the same number everywhere")
        n, h, by_row = counts.pop(), max(rows, default=1), bool(rows)
        wide = _padded(n)
        arrays = [_uniform(x, name, shape) if role == "uniform" else _lanes(x, name, n, shape, role == "row")
                  for x, role, shape, name in zip(inputs, roles, self.kernel.inputs, self.names, strict=True)]
        stateful = roles[0] == "state"
        outputs = [np.zeros((h, r * c, wide)) for r, c in self.kernel.outputs[int(stateful):]]
        stride = 0
        if stateful:
            size = arrays[0].shape[1]
            stride = size * wide if keep == "all" else 0
            states = np.empty((h + 1 if keep == "all" else 1, size, wide))
            states[0] = arrays[0][0]
            outputs.insert(0, states)
        if n:
            self._run([*arrays, *outputs], wide, h, stride)
        return tuple(self._shaped(i, output, n, by_row, keep) for i, output in enumerate(outputs))

    @property
    def machine_code(self) -> Any:
        """The kernel as a ctypes function, for compiled code that calls it by its address; see ``lanes``."""
        return self._call

    def on_threads(self, threads: int) -> Compiled:
        """The same code on several cores."""
        other = copy.copy(self)
        other.threads = threads
        return other

    def _run(self, arrays: list[np.ndarray], wide: int, rows: int, stride: int) -> None:
        pointers = [array.ctypes.data for array in arrays]
        blocks = wide // LANES
        parts = min(self.threads, blocks)
        ends = [LANES * (blocks * i // parts) for i in range(parts + 1)]
        if parts == 1:
            self._call(*pointers, wide, 0, wide, rows, stride)
            return
        with ThreadPoolExecutor(parts) as pool:  # the call releases the interpreter's lock
            list(pool.map(lambda part: self._call(*pointers, wide, *part, rows, stride), itertools.pairwise(ends)))

    def _shaped(self, i: int, output: np.ndarray, n: int, by_row: bool, keep: str) -> np.ndarray:
        r, c = self.kernel.outputs[i]
        output = output[..., :n]
        if c != 1:
            output = np.swapaxes(output.reshape(len(output), c, r, n), 1, 2)
        is_state = i == 0 and self.kernel.roles[0] == "state"
        return output if (keep == "all" if is_state else by_row) else output[-1]


def batched(function: Any, uniform: Sequence[str] = (), threads: int = 1) -> Compiled:
    """Compile a casadi.Function for many windows; inputs named in ``uniform`` have one value for all of them.

    >>> import casadi as ca
    >>> x, p = ca.SX.sym("x", 2), ca.SX.sym("p")
    >>> f = batched(ca.Function("f", [x, p], [p * x[0] + x[1]], ["x", "p"], ["y"]), uniform=["p"])
    >>> f(np.array([[1.0, 2.0, 3.0], [0.0, 0.5, 1.0]]), np.array([2.0]))[0]
    array([[2. , 4.5, 7. ]])
    """
    names = [function.name_in(i) for i in range(function.n_in())]
    _known(names, uniform)
    return Compiled(function, ["uniform" if name in uniform else "lane" for name in names], threads)


def scan(function: Any, rows: Sequence[str], uniform: Sequence[str] = (), threads: int = 1) -> Compiled:
    """Compile f(state, ...) -> (next state, ...) to run row after row; inputs named in ``rows`` change every row."""
    names = [function.name_in(i) for i in range(function.n_in())]
    _known(names, [*rows, *uniform])
    return Compiled(function, ["state", *("row" if name in rows else "uniform" if name in uniform else "lane"
                                          for name in names[1:])], threads)


def _known(names: Sequence[str], wanted: Sequence[str]) -> None:
    unknown = sorted(set(wanted) - set(names))
    if unknown:
        raise ValueError(f"no input {', '.join(unknown)}; inputs are {', '.join(names)}")

"""Folders of C for the vehicle: files that are copied, headers that are written, and what code costs there."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from string import Template

import numpy as np

from ..results.result_files import write_bytes

CLOCK_HZ = 168e6
"""STM32F405 of the Crazyflie 2.x."""
MULTIPLY_ADD_CYCLES, DIVISION_CYCLES, FUNCTION_CYCLES = 6, 14, 150
"""Assumed of a Cortex-M4F. A multiply-add has 3 (VFMA, ARM DDI 0439) and its loads and loop. Division and square root
have 14. A sine, arcsine or arctangent in float32 is a function of the C library."""


@dataclass(frozen=True)
class Operations:
    """Operations of a piece of code; ``cycles`` is an estimate."""

    multiply_adds: int
    divisions: int = 0
    functions: int = 0

    @property
    def cycles(self) -> int:
        return (MULTIPLY_ADD_CYCLES * self.multiply_adds + DIVISION_CYCLES * self.divisions
                + FUNCTION_CYCLES * self.functions)

    @property
    def milliseconds(self) -> float:
        """At 168 MHz."""
        return 1e3 * self.cycles / CLOCK_HZ


def write_folder(package: str, name: str, folder: Path, headers: Mapping[str, str],
                 readme: Mapping[str, str]) -> tuple[Path, ...]:
    """Copies the files of ``name`` in a package, fills in README.md and adds ``headers`` by path; all paths."""
    written = {path: file.read_bytes() for path, file in _files(resources.files(package).joinpath(name)).items()}
    written["README.md"] = Template(written["README.md"].decode()).substitute(readme).encode()
    written |= {path: text.encode() for path, text in headers.items()}
    for path, data in written.items():
        write_bytes(folder / path, data)
    return tuple(folder / path for path in written)


def _files(folder: Traversable, above: str = "") -> dict[str, Traversable]:
    found: dict[str, Traversable] = {}
    for entry in sorted(folder.iterdir(), key=lambda entry: entry.name):
        found |= _files(entry, f"{above}{entry.name}/") if entry.is_dir() else {f"{above}{entry.name}": entry}
    return found


def header(guard: str, what: str, target: str, body: str) -> str:
    """A header with a guard and a first line that says what it has; ``target`` of ``nanobench convert``."""
    head = f"/* {what}\n * Written by nanobench convert --to {target}. */\n"
    return f"{head}#ifndef {guard}\n#define {guard}\n\n{body}\n#endif\n"


def literal(value: float) -> str:
    """A float constant of C."""
    text = f"{np.float32(value):.9g}"
    return f"{text}f" if any(mark in text for mark in ".e") else f"{text}.0f"


def constant(name: str, value: float, comment: str) -> str:
    return f"#define {name} {literal(value)} /* {comment} */\n"


def array(name: str, values: np.ndarray, comment: str) -> str:
    """A constant array of one or two dimensions."""
    values = np.asarray(values)
    shape = "".join(f"[{size}]" for size in values.shape)
    body = _row(values) if values.ndim == 1 else "{\n    " + ",\n    ".join(map(_row, values)) + "}"
    return f"static const float {name}{shape} = {body}; /* {comment} */\n"


def _row(values: np.ndarray) -> str:
    return "{" + ", ".join(map(literal, values)) + "}"

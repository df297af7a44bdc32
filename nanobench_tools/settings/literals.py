"""Numbers in the source of the installed packages, and those that nothing explains.

A number is explained where it is plain (an index, a half, a power of a thousand), where it comes from ``settings``, or
where ``origins.toml`` says what it is (firmware, a format, an equation, a layout). There may be no others.

What this cannot see: whether an origin is true; a setting that happens to be a plain number (a fit of 3 rounds, a
weight of 0.5 inside a sum); numbers in text, in files of data, or made of plain ones (``1 / 3``).
"""

from __future__ import annotations

import ast
import functools
import math
import tomllib
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass

from . import FOLDER

ROOT = FOLDER.parents[1]
PACKAGES = ("nanobench_tools", "estimators", "controllers", "identification")
KINDS = {
    "vehicle": "of a vehicle, its firmware, sensors or radio, as published or measured by its makers",
    "published": "of an equation, algorithm or table with a source",
    "format": "of a file, protocol or program of somebody else's",
    "physics": "of nature and its units",
    "numerics": "step, tolerance or number of draws of a calculation: a finer one changes no result that is shown",
    "program": "time a program waits, size of what it keeps, speed",
    "shown": "layout and choice of what a page or table shows",
    "task": "what a protocol gives and scores",
    "safety": "limit for the safety of a flight",
    "search": "start and range of a search; data decide what it finds",
    "made": "what made-up flights and cases are made of",
}
LIMITS = frozenset({"min", "max", "clip", "minimum", "maximum"})
"""Functions whose arguments bound a value."""
KNOWN = frozenset({9.81, 0.025, 0.975, 1.4826, 1.96})
"""Gravity, and of the normal distribution: ends of 95 %, standard deviations to them and over median deviations."""
ASKS = frozenset({"number", "count", "setting"})
"""Functions of ``settings`` by which a module asks for a number."""
SHAPES = frozenset({"range", "zeros", "ones", "empty", "eye", "slice"})
"""Functions whose arguments are places or lengths."""


@dataclass(frozen=True)
class Literal:
    """module: path below the root. scope: dotted name of what it is bound to, or of the function it stands in."""

    module: str
    scope: str
    line: int
    value: float

    def __str__(self) -> str:
        return f"{self.module}:{self.line} {self.scope}: {self.value!r}"


@dataclass(frozen=True)
class Origin:
    """A declaration: ``where`` is a folder (ends with /), a module, or module:scope. It covers what is below."""

    where: str
    kind: str
    why: str

    def covers(self, literal: Literal) -> bool:
        scope = self.where.partition(":")[2]
        if scope and literal.scope != scope and not literal.scope.startswith(f"{scope}."):
            return False
        return self.speaks_of(literal.module)

    def speaks_of(self, module: str) -> bool:
        """Whether any number of ``module`` (path below the root) is covered."""
        named = self.where.partition(":")[0]
        return named == module or (named.endswith("/") and module.startswith(named))


@functools.cache
def origins() -> tuple[Origin, ...]:
    """All declarations of ``origins.toml``."""
    groups = tomllib.loads((FOLDER / "origins.toml").read_text(encoding="utf-8"))
    return tuple(Origin(where, group["kind"], group["why"]) for group in groups.values() for where in group["where"])


def sources() -> Iterator[tuple[str, str]]:
    """(path below the root, text) of every module."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            yield path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")


def modules_of(areas: Collection[str]) -> set[str]:
    """The modules that ask for settings of any of ``areas``."""
    return {module for module, text in sources() if any(_area(call) in areas for call in ast.walk(ast.parse(text)))}


def _area(node: ast.AST) -> str:
    """Of the setting that a call asks for; empty for any other node."""
    if not isinstance(node, ast.Call) or not node.args:
        return ""
    key = node.args[0]
    if not isinstance(key, ast.Constant) or not isinstance(key.value, str):
        return ""
    return key.value.partition(".")[0] if ast.unparse(node.func).rpartition(".")[2] in ASKS else ""


def literals(module: str, text: str) -> list[Literal]:
    """Numbers of one module that are not plain."""
    finder = _Finder(module)
    finder.visit(ast.parse(text))
    return finder.found


def unexplained() -> list[Literal]:
    """Numbers of all modules that neither are plain nor have a declared origin."""
    declared = origins()
    return [literal for module, text in sources() for literal in literals(module, text)
            if not any(origin.covers(literal) for origin in declared)]


def by_module(found: list[Literal]) -> dict[str, int]:
    """How many there are in each module."""
    return dict(sorted(Counter(literal.module for literal in found).items()))


class _Finder(ast.NodeVisitor):
    """Walks a module with what it stands in: ``scope`` in names, ``inside`` a function or not, ``limit`` where a number
    is compared with a value, clips it, or is what a name or an argument is bound to."""

    def __init__(self, module: str) -> None:
        self.module, self.found = module, list[Literal]()
        self.scope: tuple[str, ...] = ()
        self.inside = self.limit = False

    def visit_Constant(self, node: ast.Constant) -> None:
        if (isinstance(node.value, (int, float)) and not isinstance(node.value, bool)
                and not plain(node.value, self.limit)):
            self.found.append(Literal(self.module, ".".join(self.scope), node.lineno, node.value))

    def visit_FunctionDef(self, node: ast.FunctionDef | ast.AsyncFunctionDef) -> None:
        self._under((node.name,), True, False, node)

    visit_AsyncFunctionDef = visit_FunctionDef

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        if not any("Enum" in ast.unparse(base) or "Flag" in ast.unparse(base) for base in node.bases):
            self._under((node.name,), False, False, node)

    def visit_arguments(self, node: ast.arguments) -> None:
        self._under((), self.inside, True, node)

    def visit_Assign(self, node: ast.Assign) -> None:
        names = [name.id for target in node.targets for name in ast.walk(target) if isinstance(name, ast.Name)]
        values = node.value.elts if isinstance(node.value, ast.Tuple) else []
        if len(names) > 1 and len(values) == len(names):
            for name, value in zip(names, values, strict=True):
                self._bound(name, value)
        else:
            self._bound(names[0] if names else "", node.value)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self._bound(ast.unparse(node.target), node.value)

    def visit_Compare(self, node: ast.Compare) -> None:
        self._under((), self.inside, True, node)

    def visit_Call(self, node: ast.Call) -> None:
        name = ast.unparse(node.func).rpartition(".")[2]
        self._under((), self.inside, name in LIMITS or (self.limit and not self.inside and name not in SHAPES), node)

    def visit_Subscript(self, node: ast.Subscript) -> None:
        self.visit(node.value)  # what stands in brackets is a place

    def _bound(self, name: str, value: ast.expr) -> None:
        constant = not self.inside or name.isupper()
        if name.isupper() and isinstance(value, ast.Constant) and type(value.value) is float and value.value in (1, 2):
            self.found.append(Literal(self.module, ".".join((*self.scope, name)), value.lineno, value.value))
        self._under((name,) if constant else (), self.inside, constant or self.limit, value, children=False)

    def _under(self, scope: tuple[str, ...], inside: bool, limit: bool, node: ast.AST, children: bool = True) -> None:
        before = self.scope, self.inside, self.limit
        self.scope, self.inside, self.limit = (*self.scope, *scope), inside, limit
        (self.generic_visit if children else self.visit)(node)
        self.scope, self.inside, self.limit = before


def plain(value: float, limit: bool) -> bool:
    """Whether a number needs no origin. ``limit``: it is a name's value, a default, a threshold or a bound."""
    size = abs(value)
    if size in (0, 1, 2) or not math.isfinite(size):
        return True
    exponent = round(math.log10(size))
    power = math.isclose(size, 10.0**exponent, rel_tol=1e-12)
    if limit:
        return size in KNOWN or (power and exponent <= -6)  # keeps a divisor from zero
    small = (size <= 12 and size == int(size)) or size in (0.25, 0.5)
    unit = power and (exponent <= -6 or exponent % 3 == 0)
    return small or unit or size in (60, 90, 100, 180, 270, 360, 3600) or size in KNOWN

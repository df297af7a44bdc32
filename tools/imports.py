"""Who imports whom among the packages of the project, imports inside functions and for types included."""

import ast
import functools
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OURS = ("nanobench_tools", "estimators", "controllers", "identification")
GROUND = ("errors", "version", "units", "frames", "so3", "flight", "methods", "settings", "lookup", "results")
"""They import nothing but each other."""
PATH_OF_A_RECORDING = ("sources", "signals", "time_offsets.constant", "time_offsets.moving", "auditing.faults",
                       "auditing", "harness", "protocols", "pages", "steps", "cli", "api")
"""In this order: each may import those before it ("Who may import whom" in ARCHITECTURE.md)."""

BESIDE: dict[str, set[str]] = {
    "time_offsets.mathematics": set(), "metrics": set(), "noise": set(), "physics": set(), "firmware": set(),
    "tables": set(),
    "practice": {"firmware", "sources", "signals", "time_offsets.moving", "auditing.faults"}}
"""What is used from several places of the path, and what each may import above the ground."""
SURFACE = ("steps", "cli", "api")
METHODS = ("estimators", "controllers", "identification")
"""Handed to the protocols by the surface, which alone imports them."""


def package_of(module: str) -> str:
    """The folder below one of ours, or that folder of it which has a place of its own in the order."""
    top, *inside = module.split(".")
    depth = 2 if ".".join(inside[:2]) in {*PATH_OF_A_RECORDING, *BESIDE} else 1
    return ".".join([top, *inside[:depth]])


def modules() -> dict[str, Path]:
    found = {}
    for top in OURS:
        for path in (ROOT / top).rglob("*.py"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported(name: str, text: str, is_package: bool, known: Iterable[str]) -> set[str]:
    """Modules of ``known`` that ``text``, the module ``name``, imports anywhere."""
    known = set(known)

    def module_of(dotted: str) -> str:
        while dotted and dotted not in known:
            dotted = dotted.rpartition(".")[0]
        return dotted

    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {module_of(alias.name) for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            package = name.split(".") if is_package else name.split(".")[:-1]
            here = package[: len(package) - (node.level - 1)] if node.level else []
            base = ".".join([*here, *([node.module] if node.module else [])])
            found |= {module_of(f"{base}.{alias.name}") for alias in node.names}
    return found - {"", name}


@functools.cache
def import_graph() -> dict[str, set[str]]:
    """Module -> modules that it imports."""
    found = modules()
    return {name: imported(name, path.read_text("utf-8"), path.name == "__init__.py", found)
            for name, path in found.items()}


def package_graph(graph: dict[str, set[str]]) -> dict[str, set[str]]:
    """Package -> other packages that its modules import."""
    found = defaultdict[str, set[str]](set)
    for name, others in graph.items():
        found[package_of(name)] |= {package_of(other) for other in others} - {package_of(name)}
    return dict(found)

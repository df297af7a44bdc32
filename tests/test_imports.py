"""Who imports whom: no circle of modules and none of packages, imports inside functions and for types included."""

from collections.abc import Mapping

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from tools.imports import BESIDE, GROUND, METHODS, PATH_OF_A_RECORDING, SURFACE, import_graph, imported, package_graph


def circles(graph: Mapping[str, set[str]]) -> list[list[str]]:
    """Groups of two or more that reach each other (strongly connected components)."""
    names = sorted(graph)
    edges = csr_array([[other in graph[name] for other in names] for name in names])
    _, group = connected_components(edges, connection="strong")
    groups = (np.flatnonzero(group == g) for g in np.flatnonzero(np.bincount(group) > 1))
    return sorted([names[k] for k in members] for members in groups)


@pytest.fixture(scope="module")
def graph():
    return import_graph()


@pytest.fixture(scope="module")
def packages(graph):
    return package_graph(graph)


def test_no_circle_of_modules(graph):
    assert len(graph) > 500
    assert circles(graph) == []


def test_no_circle_of_packages(packages):
    assert circles(packages) == []


def test_the_ground_imports_nothing_above_it(packages):
    allowed = {f"nanobench_tools.{name}" for name in GROUND} | {"nanobench_tools"}
    assert {name: packages[f"nanobench_tools.{name}"] - allowed for name in GROUND
            if packages[f"nanobench_tools.{name}"] - allowed} == {}


def test_the_mathematics_of_delays_knows_no_streams(packages):
    assert packages["nanobench_tools.time_offsets.mathematics"] <= {"nanobench_tools.settings"}


def test_a_recording_goes_one_way(packages):
    for place, name in enumerate(PATH_OF_A_RECORDING):
        later = {f"nanobench_tools.{other}" for other in PATH_OF_A_RECORDING[place + 1:]}
        assert packages[f"nanobench_tools.{name}"] & later == set(), name


@pytest.mark.parametrize("name", BESIDE)
def test_what_several_use_stands_below_them(name, packages):
    allowed = {"nanobench_tools", *(f"nanobench_tools.{other}" for other in {*GROUND, *BESIDE[name]})}
    assert packages[f"nanobench_tools.{name}"] - allowed == set()


def test_the_surface_alone_knows_the_methods(graph):
    assert [name for name, others in graph.items()
            if name.startswith("nanobench_tools.")
            and not name.startswith(tuple(f"nanobench_tools.{one}." for one in SURFACE))
            and any(other.split(".")[0] in METHODS for other in others)] == []


def test_the_command_line_and_the_python_functions_stand_beside_each_other(packages):
    assert "nanobench_tools.cli" not in packages["nanobench_tools.api"]
    assert "nanobench_tools.api" not in packages["nanobench_tools.steps"] | packages["nanobench_tools.cli"]


def test_estimators_know_no_protocol(packages):
    above = {f"nanobench_tools.{name}" for name in ("protocols", "harness", "pages", *SURFACE)}
    assert {name: others & above for name, others in packages.items()
            if name.split(".")[0] == "estimators" and others & above} == {}


def test_imports_are_found_wherever_they_stand():
    known = ("a", "a.b", "a.b.c", "a.b.d", "a.e", "f")
    text = ("from typing import TYPE_CHECKING\nfrom . import d\nfrom ..e import thing\n"
            "if TYPE_CHECKING:\n    import f\ndef g():\n    from a.b import other\n")
    assert imported("a.b.c", text, False, known) == {"a.b.d", "a.e", "f", "a.b"}
    assert imported("a.b", "from .c import x", True, known) == {"a.b.c"}


def test_a_circle_is_found_and_a_chain_is_none():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}) == [["b", "c"]]
    assert circles({"a": {"b"}, "b": {"c"}, "c": set()}) == []

"""The site: pages from the code are whole, links are checked, limits in the text are those of the code."""

import dataclasses
import inspect

import pytest
import yaml

import nanobench_tools as nb
from identification.mismatch.headline import RULES
from nanobench_tools.auditing.faults.kinds import kinds
from nanobench_tools.cli.main import VERBS
from nanobench_tools.lookup import registry
from tools.docs_site import check_links, docstring_text, generated, imports_picture, peers

DOCS = generated.ROOT / "docs"


class Config(yaml.SafeLoader):
    """Passes over the tags of MkDocs."""


Config.add_multi_constructor("tag:yaml.org,2002:python/name:", lambda loader, suffix, node: suffix)


def test_the_reference_has_every_function_of_the_package():
    functions = {name for name in nb.__all__ if inspect.isfunction(getattr(nb, name, None))} - {"make_stream"}
    assert {name for names in generated.FUNCTIONS.values() for name in names} == functions


@pytest.mark.parametrize(("page", "names"), [
    (generated.faults, list(kinds())), (generated.terms, registry.names("terms")),
    (generated.sources, registry.names("sources")),
    (generated.methods, [*registry.names("estimators"), *registry.names("controllers")]),
    (generated.metrics, ["trajectory", "statistics"])])
def test_a_page_has_an_entry_for_each(page, names):
    text = page()
    assert [name for name in names if f"`{name}`" not in text] == []


def test_types_of_result_files_are_as_the_code_writes_them():
    """Which needs ``from __future__ import annotations`` in their files."""
    text = generated.schemas()
    assert "class '" not in text
    assert "collections.abc" not in text


def documented(function, section="Parameters"):
    """Names of a section of a docstring, without stars."""
    text = docstring_text.sections(inspect.getdoc(function) or "").get(section, "")
    return {name.lstrip("*") for name in docstring_text.entries(text)}


def taken(function):
    return {name for name in inspect.signature(function).parameters if name not in ("self", "cls")}


def test_every_parameter_of_a_term_is_documented_with_its_unit_and_shape():
    for name, term in registry.load_all("terms").items():
        told = docstring_text.entries(generated.term_text(name)["Parameters"])
        assert list(told) == [p.name for p in term.parameters], name
        for p in term.parameters:
            shape, _, unit = told[p.name][0].partition(", " if p.length == 0 else " ")
            wanted = {0: "float", None: "(k,)", "rotors": "(rotors,)"}.get(p.length, f"({p.length},)")
            assert (shape, unit, bool(told[p.name][1])) == (wanted, p.unit, True), f"{name}.{p.name}"


def public_methods():
    for name in nb.__all__:
        kind = getattr(nb, name)
        for method, found in vars(kind).items() if inspect.isclass(kind) and kind.__module__ != "builtins" else ():
            function = getattr(found, "__func__", found)
            if not method.startswith("_") and inspect.isfunction(function) and (kind, method) != (nb.Flight, "retimed"):
                yield f"nb.{name}.{method}", function


def test_functions_and_methods_of_the_package_document_what_they_take_and_give():
    functions = [(f"nb.{name}", getattr(nb, name)) for names in generated.FUNCTIONS.values() for name in names]
    wrong = {}
    for name, function in [*functions, *public_methods()]:
        if taken(function) != documented(function) or not inspect.getdoc(function):
            wrong[name] = taken(function) ^ documented(function)
        elif taken(function) and "None" not in str(inspect.signature(function).return_annotation) \
                and "Returns" not in docstring_text.sections(inspect.getdoc(function)):
            wrong[name] = "Returns"
    assert wrong == {}


def test_metrics_document_what_they_take_and_give():
    wrong = []
    for file in generated.metric_files():
        for name, found in vars(file).items():
            if name.startswith("_") or getattr(found, "__module__", "") != file.__name__:
                continue
            if inspect.isfunction(found):
                wrong += [name] * (taken(found) != documented(found) or not documented(found, "Returns"))
            elif dataclasses.is_dataclass(found):
                wrong += [name] * ({f.name for f in dataclasses.fields(found)} != documented(found, "Attributes"))
    assert wrong == []


@pytest.mark.parametrize("group", ["estimators", "controllers", "predictors"])
def test_registered_methods_document_how_they_are_made(group):
    wrong = {}
    for name, kind in registry.load_all(group).items():
        if inspect.isfunction(vars(kind).get("__init__")) and taken(kind) != documented(kind):
            wrong[name] = taken(kind) ^ documented(kind)
    assert wrong == {}


def test_every_key_of_a_result_file_has_a_meaning():
    missing = []
    for _, places in generated.RESULT_FILES.values():
        for place in places:
            found = generated._load(place)
            if inspect.isclass(found):
                missing += [f"{place}.{name}" for name in
                            {f.name for f in dataclasses.fields(found)} ^ documented(found, "Attributes")]
    assert missing == []


def test_comparisons_with_other_tools_are_those_that_were_measured():
    assert set(peers.SPEED) - set(peers.ratios()) == set()
    assert [test for *_, test in peers.AGREEMENT if not (generated.ROOT / test).is_file()] == []
    assert "| pysindy, " in peers.page()


def test_sections_of_a_docstring_are_lists():
    text = docstring_text.markdown("Does it.\n\nParameters\n----------\na, b : float, m\n    Two\n    lengths.\n\n"
                                   "References\n----------\nSomebody 1999.\n")
    assert text == ("Does it.\n\n**Parameters**\n\n- `a` (float, m): Two lengths.\n- `b` (float, m): Two lengths."
                    "\n\n**References**\n\nSomebody 1999.")


def test_error_messages_have_a_place_and_a_remedy():
    found = generated.error_calls()
    assert set(found) == {"InputError", "UsageError", "MissingExtraError"}
    assert len(found["InputError"]) > 200
    assert sum(bool(remedy) for _, _, remedy in found["InputError"]) > 100


def test_every_page_is_in_the_navigation():
    def places(entries):
        for entry in entries:
            for value in [entry] if isinstance(entry, str) else entry.values():
                yield from [value] if isinstance(value, str) else places(value)

    nav = set(places(yaml.load((generated.ROOT / "mkdocs.yml").read_text("utf-8"), Config)["nav"]))
    there = {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")} | set(generated.PAGES)
    assert there - nav == set()
    assert {place for place in nav - there if not place.startswith("project/")} == set()


def test_lines_of_the_picture_lead_down_and_none_is_explained_by_another():
    graph = {"d": {"c", "b", "a"}, "c": {"a"}, "b": {"a"}, "a": set()}
    assert imports_picture.rows_of(graph) == {"a": 0, "b": 1, "c": 1, "d": 2}
    assert imports_picture.direct(graph) == {("d", "c"), ("d", "b"), ("c", "a"), ("b", "a")}
    ours, lines = imports_picture.places()
    assert {"cli", "ground", "estimators", "controllers", "identification.mismatch"} <= set(ours)
    assert min(lines[name] for name in ours) >= imports_picture.SMALLEST
    drawn = imports_picture.picture()
    assert [name for name in ours if f">{name}</text>" not in drawn] == []


def test_limits_of_the_uses_are_those_of_the_code():
    text = (DOCS / "howto/is_my_simulator_good_enough.md").read_text("utf-8")
    assert [rule for rule in RULES.values() if rule not in text] == []


def test_broken_links_and_files_from_the_web_are_found(tmp_path):
    (tmp_path / "a.html").write_text('<h1 id="top">x</h1><a href="b.html#here">b</a><a href="a.html#top">a</a>'
                                     '<a href="c.html">c</a><script src="https://cdn.example/x.js"></script>'
                                     '<img src="p.svg">')
    (tmp_path / "b.html").write_text('<p id="there">x</p><a href="https://example.org">w</a>')
    found = check_links.problems(tmp_path)
    assert [line.partition(": ")[2] for line in found] == [
        "1 pictures without alternative text", "loads https://cdn.example/x.js from the web",
        "b.html#here has no such anchor", "c.html leads nowhere", "p.svg leads nowhere"]


def test_docstrings_become_markdown():
    text = docstring_text.markdown("Does it, ``fast``::\n\n    a = 1\n\nSee.\n\n>>> f()\n1\n")
    assert text == "Does it, `fast`:\n\n```text\na = 1\n```\n\nSee.\n\n```pycon\n>>> f()\n1\n```"


def test_every_verb_is_on_the_page_of_the_command_line():
    text = generated.command_line()
    assert [verb for verb in VERBS if f"## nanobench {verb} " not in text] == []

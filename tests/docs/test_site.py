"""The site: pages from the code are whole, links are checked, limits in the text are those of the code."""

import inspect

import pytest
import yaml

import nanobench_tools as nb
from identification.mismatch.headline import RULES
from nanobench_tools.auditing.faults.kinds import kinds
from nanobench_tools.cli.main import VERBS
from nanobench_tools.lookup import registry
from tools.docs_site import check_links, docstring_text, generated, imports_picture

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
    (generated.methods, [*registry.names("estimators"), *registry.names("controllers")])])
def test_a_page_has_an_entry_for_each(page, names):
    text = page()
    assert [name for name in names if f"`{name}`" not in text] == []


def test_types_of_result_files_are_as_the_code_writes_them():
    """Which needs ``from __future__ import annotations`` in their files."""
    text = generated.schemas()
    assert "class '" not in text
    assert "collections.abc" not in text


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

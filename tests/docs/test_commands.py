"""Commands that README.md, docs/*.md and docs/figures name exist, with the options that stand behind them."""

import functools
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from nanobench_tools.cli.main import VERBS
from tools.docs_site.generated import PAGES
from tools.figures.__main__ import pages
from tools.figures.store import ROOT, Store

COMMAND = re.compile(r"\bnanobench ([a-z]+)\b([^`\n;]*)")
SOURCES = re.compile(r"(?:benchmarks|tests|nanobench_tools|estimators|controllers|identification)/[\w/*]+\.(?:py|toml)")


@functools.cache
def options_of(verb: str) -> frozenset[str]:
    command = getattr(importlib.import_module(f"nanobench_tools.cli.{verb}"), verb)
    return frozenset(o for p in command.params for o in (*p.opts, *p.secondary_opts)) | {"--help"}


def commands(text: str) -> Iterator[tuple[str, list[str]]]:
    """(verb, its options) of every `nanobench VERB ...` in code, fenced, indented or inline."""
    for match in COMMAND.finditer(re.sub(r"\\\n\s*", " ", re.sub(r"#.*", "", text))):
        yield match[1], re.findall(r"(?<![\w-])--[a-z][a-z-]*", match[2])


def code_of(page: str) -> str:
    """Code of a page: fences, indented lines and `inline` (which may go over a line's end)."""
    fences = re.findall(r"^```.*?\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    rest = re.sub(r"^```.*?^```", "", page, flags=re.DOTALL | re.MULTILINE)
    inline = [" ".join(c.split()) for c in re.findall(r"`([^`]+)`", rest)]
    return "\n".join([*fences, *re.findall(r"^    (\S.*)$", rest, re.MULTILINE), *inline])


def wrong(text: str) -> list[str]:
    found = []
    for verb, options in commands(text):
        if verb not in VERBS:
            found.append(f"nanobench {verb}")
        else:
            found += [f"nanobench {verb} {o}" for o in options if o not in options_of(verb)]
    return found


@pytest.mark.parametrize("page", [*pages(), *sorted((ROOT / "docs").glob("*/*.md"))], ids=lambda p: p.name)
def test_commands_of_a_page_exist(page: Path) -> None:
    assert wrong(code_of(page.read_text())) == []


def test_commands_of_stored_figures_exist() -> None:
    for name, source in Store.load().sources.items():
        assert wrong(source.get("command", "")) == [], name


@pytest.mark.parametrize("page", pages(), ids=lambda p: p.name)
def test_scripts_and_files_of_a_page_exist(page: Path) -> None:
    named = SOURCES.findall(page.read_text())
    assert [n for n in named if not list(ROOT.glob(n))] == []


def test_scripts_of_stored_figures_exist() -> None:
    for name, source in Store.load().sources.items():
        for script in re.findall(r"\b(?:benchmarks|tests)/[\w/]+\.py", source.get("command", "")):
            assert (ROOT / script).is_file(), name


def test_links_between_pages_lead_somewhere() -> None:
    for page in pages():
        for target in re.findall(r"\]\(([^)#:]+\.md)(?:#[\w-]+)?\)", page.read_text()):
            there = (page.parent / target).resolve()
            written = there.is_relative_to(ROOT / "docs") and str(there.relative_to(ROOT / "docs")) in PAGES
            assert written or there.is_file(), f"{page.name}: {target}"


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("nanobench audit --data x", []),
        ("nanobench vanish --data x", ["nanobench vanish"]),
        ("nanobench audit --teleport", ["nanobench audit --teleport"]),
    ],
)
def test_a_wrong_command_is_found(text: str, found: list[str]) -> None:
    assert wrong(text) == found

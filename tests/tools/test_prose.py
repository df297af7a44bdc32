"""The check of the wording finds what it must, and passes over what is not prose."""

import tomllib
from pathlib import Path

import pytest

from tools import prose

RULES = tomllib.loads((prose.ROOT / "tools/prose.toml").read_text("utf-8"))


def found(text: str) -> list[str]:
    return [f.instead for f in prose.findings(prose.Text("pages", Path("page.md"), 1, text), RULES)]


@pytest.mark.parametrize("text", [
    "One trim cannot tell which cause it was.",
    "Rows that are none of these stay.",
    "The effect is withdrawn at this step.",
    "Every flight has its own value of the gain.",
    "word " * 26,
])
def test_hard_wording_is_found(text):
    assert len(found(text)) == 1


@pytest.mark.parametrize("text", [
    "The audit removes these rows.",
    "The table of a thrust stand series is read.",
    "Run `nothing tells what is withdrawn` here.",
    "```\nwhatever stands here is code\n```\nA short sentence follows here.",
    "| this | row stands in a table |\n",
    "word " * 25,
    "Parameters\n----------\nseed : int\n    Of a thing.\n\nRaises\n------\nInputError\n    " + "word " * 25,
])
def test_plain_wording_and_code_are_passed_over(text):
    assert found(text) == []


def test_texts_of_a_file(tmp_path):
    path = tmp_path / "a.py"
    path.write_text(
        '"""One docstring."""\nX = "a message of five words"  # a reason here\n'
        'Y = f"row {X} of file {X} is bad # no"\n')
    kinds = [(t.kind, t.line) for t in prose.code_texts(path)]
    assert kinds == [("docstrings", 1), ("messages", 2), ("messages", 3), ("comments", 2)]


def test_pages_have_no_finding():
    texts = list(prose.page_texts(prose.ROOT))
    assert len(texts) > 10
    assert [f.sentence for t in texts for f in prose.findings(t, RULES)] == []

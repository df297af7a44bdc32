"""Check how the project reads: long sentences, and wording that readers of the field do not know.

``python -m tools.prose`` compares README, docs, docstrings, messages and comments with the rules and limits of
``tools/prose.toml``. ``--list`` prints every finding with its place and what to write instead.
"""

import argparse
import ast
import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PAGES = ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "docs/**/*.md")
CODE = ("nanobench_tools", "estimators", "controllers", "identification", "benchmarks", "notebooks")
MESSAGE_WORDS = 5
"""A shorter constant is a key, a name or a label rather than a sentence."""

_LEFT_OUT = re.compile(r"```.*?```|`+[^`\n]*`+|<!--.*?-->|\$\$.*?\$\$|\$[^$\n]+\$", re.S)
_LINES_LEFT_OUT = re.compile(r"^\s*(\||#|>>>|\.\.\.|!!!|:::|!\[).*$", re.M)
_SECTION = re.compile(r"^[ \t]*(?:\w[\w ]*\n[ \t]*-{3,}|\w[\w, ]* : [^\n]*|[A-Z]\w+)[ \t]*$", re.M)
"""Headings of numpydoc sections, and their lines of names and types."""
_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")
_BREAK = re.compile(r"(?<=[.!?;])\s+(?=[A-Z`(*])|\n\s*\n|^\s*(?:[-*]|\d+\.) ", re.M)
_COMMENT = re.compile(r"(?:^|\s)#\s(.*)$")


class Text(NamedTuple):
    """A piece of text: its kind (a key of the limits), its file and line."""

    kind: str
    path: Path
    line: int
    text: str


class Finding(NamedTuple):
    """A sentence that breaks a rule, and what to write instead."""

    text: Text
    sentence: str
    instead: str


def sentences(text: str) -> Iterator[str]:
    """Yield the sentences of a text without code, tables, headings and formulas."""
    text = _LINES_LEFT_OUT.sub("", _SECTION.sub("\n", _LEFT_OUT.sub(" X ", text)))
    text = _LINK.sub(r"\1", text)
    for part in _BREAK.split(text):
        words = part.split()
        if len(words) > 2:
            yield " ".join(words)


def page_texts(root: Path) -> Iterator[Text]:
    for pattern in PAGES:
        for path in sorted(root.glob(pattern)):
            yield Text("pages", path, 1, path.read_text(encoding="utf-8"))


def code_texts(path: Path) -> Iterator[Text]:
    """Yield the docstrings, messages and comments of a Python file."""
    source = path.read_text(encoding="utf-8")
    documented: set[int] = set()
    inside: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            for line in body:
                if isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant) \
                        and isinstance(line.value.value, str):
                    documented.add(id(line.value))
                    inside.update(range(line.value.lineno, (line.value.end_lineno or 0) + 1))
                    yield Text("docstrings", path, line.value.lineno, line.value.value)
        elif isinstance(node, ast.JoinedStr):
            documented.update(id(part) for part in node.values)
            text = "".join(str(p.value) if isinstance(p, ast.Constant) else "X" for p in node.values)
            inside.update(range(node.lineno, (node.end_lineno or 0) + 1))
            if len(text.split()) >= MESSAGE_WORDS:
                yield Text("messages", path, node.lineno, text)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documented:
            inside.update(range(node.lineno + 1, (node.end_lineno or 0)))
            if len(node.value.split()) >= MESSAGE_WORDS:
                yield Text("messages", path, node.lineno, node.value)
    for number, line in enumerate(source.splitlines(), 1):
        if "#" in line and number not in inside and (found := _COMMENT.search(line)):
            yield Text("comments", path, number, found[1])


def texts(root: Path) -> Iterator[Text]:
    """Yield every text that is checked."""
    yield from page_texts(root)
    for folder in CODE:
        for path in sorted((root / folder).rglob("*.py")):
            yield from code_texts(path)


def findings(text: Text, rules: dict[str, Any]) -> Iterator[Finding]:
    """Yield what breaks a rule in a text, one finding a sentence and rule."""
    compiled = [(re.compile(rule["pattern"], re.I), rule["instead"]) for rule in rules["rules"]]
    for sentence in sentences(text.text):
        if (n := len(sentence.split())) > rules["longest_sentence"]:
            yield Finding(text, sentence, f"shorter sentences: {n} words")
        for pattern, instead in compiled:
            if pattern.search(sentence):
                yield Finding(text, sentence, instead)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.prose", description=__doc__)
    parser.add_argument("--list", action="store_true",
                        help="print every finding, not only those of a kind over its limit")
    rules = tomllib.loads((ROOT / "tools/prose.toml").read_text(encoding="utf-8"))
    listed = parser.parse_args().list
    found = [finding for text in texts(ROOT) for finding in findings(text, rules)]
    counts = Counter(finding.text.kind for finding in found)
    over = {kind for kind, limit in rules["limits"].items() if counts[kind] > limit}
    for finding in found:
        if listed or finding.text.kind in over:
            print(f"{finding.text.path.relative_to(ROOT)}:{finding.text.line}: {finding.sentence[:140]}"
                  f"\n    write: {finding.instead}")
    print("; ".join(f"{kind} {counts[kind]} (limit {limit})" for kind, limit in rules["limits"].items()))
    if over:
        print(f"prose: more findings than tools/prose.toml allows in {', '.join(sorted(over))}")
    return 1 if over else 0


if __name__ == "__main__":
    raise SystemExit(main())

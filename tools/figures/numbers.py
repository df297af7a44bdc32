"""Numbers that stand in a page outside a mark.

A digit in the text of a page has to come from a mark, from code (a fence or `backticks`) or be one of the harmless
kinds below. What this cannot see: numbers in words ("three of seven"), numbers in code, and a sentence that says of a
right number what it does not show. For the last there is `holds` (text.py).
"""

from __future__ import annotations

import re

from markdown_it import MarkdownIt
from markdown_it.token import Token

#: kind -> pattern; each match is taken out before digits are looked for
HARMLESS = {
    "date": r"\b\d{4}-\d{2}-\d{2}\b",
    "version": r"\b(?:Python|ROS|RotorPy|cflib|firmware|TinyMPC|version|versions) \d[\d.]*(?: (?:and|or) \d[\d.]*)*",
    "task": r"\bTasks? [123](?:, [123])*(?: (?:and|to) [123])?\b",
    "exponent": r"\^-?\d+",
    "interval": r"\b95 % (?=intervals?\b)",
    "dimensions": r"\b[23]-D\b",
    "acronym": r"\b[A-Z]{2,}-\d[\d.]*(?:-\w+)?",
    "name": r"(?<![\w.])[A-Za-z][A-Za-z_]*-?\d+(?:[\w-]*)(?!\.\d)",
}
MARKS = re.compile(r"<!-- (/?)(?:fig|code|table)\b")


def unmarked(text: str) -> list[str]:
    """Pieces of a page with a digit outside marks, code and harmless kinds, each with its line."""
    found: list[str] = []
    inside = False
    for token in MarkdownIt("commonmark").enable("table").parse(text):
        line = (token.map or [0])[0] + 1
        if token.type == "html_block":
            inside = _after(token.content, inside)
            if not inside and not MARKS.search(token.content):
                found += _digits(re.sub(r"<!--.*?-->", "", token.content, flags=re.DOTALL), line)
        elif token.type == "inline" and not inside:
            found += [f for piece in _pieces(token.children or []) for f in _digits(piece, line)]
    return found


def _pieces(tokens: list[Token]) -> list[str]:
    """The running text of a paragraph, marks and code left out."""
    words, inside = "", False
    for token in tokens:
        if token.type == "html_inline":
            inside = _after(token.content, inside)
        elif token.type in ("softbreak", "hardbreak"):
            words += " "
        elif token.type == "code_inline":
            words += "`"
        elif token.type == "text" and not inside:
            words += token.content
    return [words]


def _after(html: str, inside: bool) -> bool:
    """Whether text after this piece of HTML stands in a mark."""
    for match in MARKS.finditer(html):
        inside = not match[1]
    return inside


def _digits(text: str, line: int) -> list[str]:
    for pattern in HARMLESS.values():
        text = re.sub(pattern, lambda m: "#" * len(m[0]), text)
    places = re.finditer(r"\d[\d.,]*", text)
    return [f"line {line}: {text[max(0, m.start() - 30) : m.end() + 20].strip()}" for m in places]

"""Numbers in the text of a page that no table of their section contains.

A digit in the text comes from a table of `make figures` in the same section, from code (a fence or `backticks`), or is
one of the harmless kinds below. What this cannot see: numbers in words ("three of seven"), numbers in code, and a
sentence that misreads its table. For the last there is `holds` (text.py).
"""

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
NUMBER = re.compile(r"\d[\d,]*(?:\.\d+)?")


def without_table(text: str) -> list[str]:
    """Pieces of a page with a number that is in no table of the section, in code or harmless, each with its line."""
    found: list[str] = []
    pieces: list[tuple[str, int]] = []
    known: set[str] = set()
    inside = False
    for token in MarkdownIt("commonmark").enable("table").parse(text):
        line = (token.map or [0])[0] + 1
        if token.type == "heading_open":
            found += _unknown(pieces, known)
            pieces, known = [], set()
        elif token.type == "html_block":
            inside = "<!-- table:" in token.content or (inside and "<!-- /table" not in token.content)
            pieces.append((re.sub(r"<!--.*?-->|<[^>]*>", "", token.content, flags=re.DOTALL), line))
        elif token.type == "inline" and inside:
            known |= set(NUMBER.findall(token.content))
        elif token.type == "inline":
            pieces.append((_words(token.children or []), line))
    return found + _unknown(pieces, known)


def _words(tokens: list[Token]) -> str:
    """The running text of a paragraph, code left out."""
    shown = {"softbreak": " ", "hardbreak": " ", "code_inline": "`"}
    return "".join(t.content if t.type == "text" else shown.get(t.type, "") for t in tokens)


def _unknown(pieces: list[tuple[str, int]], known: set[str]) -> list[str]:
    found = []
    for text, line in pieces:
        for pattern in HARMLESS.values():
            text = re.sub(pattern, lambda m: "#" * len(m[0]), text)
        found += [f"line {line}: {text[max(0, m.start() - 30) : m.end() + 20].strip()}"
                  for m in NUMBER.finditer(text) if m[0] not in known]
    return found

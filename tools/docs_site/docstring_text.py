"""Docstrings as Markdown: examples in fences, literal blocks, numpydoc sections, and code in single backquotes."""

import inspect
import re

_TITLE = re.compile(r"^(Parameters|Attributes|Returns|Raises|Notes|References|Examples)\n-{3,}\n", re.M)
_OF_ENTRIES = ("Parameters", "Attributes", "Returns", "Raises")


def sections(text: str) -> dict[str, str]:
    """Return the numpydoc sections of a docstring by title; the text before them under ``""``."""
    pieces = _TITLE.split(inspect.cleandoc(text) + "\n")
    return {"": pieces[0].strip(), **dict(zip(pieces[1::2], map(str.strip, pieces[2::2]), strict=True))}


def entries(section: str) -> dict[str, tuple[str, str]]:
    """Return {name: (type, description)} of a section; names that share an entry have equal values.

    >>> entries("a, b : float, m\\n    Two lengths.")
    {'a': ('float, m', 'Two lengths.'), 'b': ('float, m', 'Two lengths.')}
    """
    found: dict[str, tuple[str, str]] = {}
    for block in filter(None, re.split(r"\n(?=\S)", section)):
        head, _, body = block.partition("\n")
        names, _, kind = head.partition(" : ")
        found |= {name.strip(): (kind.strip(), " ".join(body.split())) for name in names.split(",")}
    return found


def markdown(text: str) -> str:
    """Return a docstring as Markdown.

    Runs of ``>>>`` lines with their output become a fence; an indented block after ``::`` too. Sections get a title in
    bold and a list of their entries.
    """
    head, *others = sections(text).items()
    parts = [_plain(head[1])]
    for title, body in others:
        listed = "\n".join(f"- {_item(*entry)}" for entry in entries(body).items()) if title in _OF_ENTRIES else ""
        parts.append(f"**{title}**\n\n{_plain(listed or body)}")
    return "\n\n".join(parts).strip()


def _item(name: str, entry: tuple[str, str]) -> str:
    kind, text = entry
    return f"``{name}``" + (f" ({kind})" if kind else "") + (f": {text}" if text else "")


def _plain(text: str) -> str:
    lines = inspect.cleandoc(text).splitlines()
    out: list[str] = []
    at = 0
    while at < len(lines):
        line = lines[at]
        if line.lstrip().startswith(">>>"):
            block = []
            while at < len(lines) and lines[at].strip():
                block.append(lines[at].strip() if lines[at].lstrip().startswith(">>>") else lines[at])
                at += 1
            out += ["", "```pycon", *block, "```", ""]
            continue
        if line.rstrip().endswith("::"):
            out.append(line.rstrip()[:-1])
            at += 1
            block = []
            while at < len(lines) and (not lines[at].strip() or lines[at].startswith(" ")):
                block.append(lines[at])
                at += 1
            out += ["", "```text", *inspect.cleandoc("\n".join(["", *block])).splitlines(), "```", ""]
            continue
        out.append(line.replace("\b", ""))
        at += 1
    return re.sub(r"``([^`\n]+)``", r"`\1`", re.sub(r"\n{3,}", "\n\n", "\n".join(out))).strip()


def cell(text: str) -> str:
    """Return text for a cell of a Markdown table."""
    return " ".join(markdown(text).split()).replace("|", "\\|").replace("<", "&lt;")

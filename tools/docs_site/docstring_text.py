"""Docstrings as Markdown: examples in fences, literal blocks, and code in single backquotes."""

import inspect
import re


def markdown(text: str) -> str:
    """Return a docstring as Markdown.

    Runs of ``>>>`` lines with their output become a fence; an indented block after ``::`` too.
    """
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

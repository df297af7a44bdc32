"""Griffe extension: docstrings reach mkdocstrings as Markdown."""

import re
from typing import Any

import griffe

from .docstring_text import markdown

SECTION = re.compile(r"^\w[\w ]*\n-{3,}$", re.M)


class MarkdownDocstrings(griffe.Extension):
    """Turn examples and literal blocks into fences. Docstrings with numpydoc sections keep their examples."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        if obj.docstring is not None and not SECTION.search(obj.docstring.value):
            obj.docstring.value = markdown(obj.docstring.value)

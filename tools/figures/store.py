"""What the pages quote: docs/figures/*.json, one file a source.

A source is one command and what was quoted of its result. Keys are `source/dotted.path`. A file contains

    command, data (what was measured, real or SYNTHETIC), version, date, source_sha256
    figures: {...}              nested, floats in SI

The source `published` is nanobench_tools/protocols/published.toml.
"""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "figures"
PUBLISHED = ROOT / "nanobench_tools" / "protocols" / "published.toml"
#: what a dictionary of statistics means where no part of it is asked for
PLAIN = ("value", "mean")


class FigureError(Exception):
    """A mark, key, format or table that is wrong; says where."""


@dataclass(frozen=True)
class Store:
    """Stored figures by source, and the table layouts of docs/figures/*.toml."""

    sources: dict[str, dict[str, Any]] = field(default_factory=dict)
    layouts: dict[str, dict[str, Any]] = field(default_factory=dict)

    @classmethod
    def load(cls, folder: Path = FOLDER) -> Store:
        sources = {p.stem: json.loads(p.read_text()) for p in sorted(folder.glob("*.json"))}
        sources["published"] = {"data": "published tables", "figures": tomllib.loads(PUBLISHED.read_text())}
        layouts = {p.stem: tomllib.loads(p.read_text()) for p in sorted(folder.glob("*.toml"))}
        return cls(sources, layouts)

    def source(self, name: str) -> dict[str, Any]:
        if name not in self.sources:
            raise FigureError(f"{name}: no docs/figures/{name}.json")
        return self.sources[name]

    def node(self, key: str) -> Any:
        """The stored value, list or dictionary of a key."""
        source, _, path = key.partition("/")
        if not path:
            raise FigureError(f"{key}: a key is source/path")
        here: Any = self.source(source).get("figures", {})
        for part in path.split("."):
            if here is None:  # what a result leaves open is open in all its parts
                return None
            if isinstance(here, list) and part.isdigit() and int(part) < len(here):
                here = here[int(part)]
            elif isinstance(here, dict) and part in here:
                here = here[part]
            else:
                raise FigureError(f"{key}: no {part!r} in docs/figures/{source}.json")
        return here

    def has(self, key: str) -> bool:
        try:
            self.node(key)
        except FigureError:
            return False
        return True

    def value(self, key: str) -> Any:
        """The stored value of a key; of statistics the mean."""
        node = self.node(key)
        if isinstance(node, dict):
            for name in PLAIN:
                if name in node:
                    return node[name]
            raise FigureError(f"{key}: holds {', '.join(node)}; say which")
        return node

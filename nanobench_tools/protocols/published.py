"""The published tables, read from ``published.toml`` beside this file, and put into the rows they belong to."""

from __future__ import annotations

import functools
import tomllib
from pathlib import Path
from typing import Any


@functools.cache
def published() -> dict[str, Any]:
    """{task1, task2, task3} as in published.toml: metrics in SI, {mean, std} over flights (task 1: by horizon)."""
    return tomllib.loads((Path(__file__).with_name("published.toml")).read_text(encoding="utf-8"))


def beside(row: dict[str, Any], task: str, kind: str, name: str) -> dict[str, Any]:
    """``row`` with keys ``published`` ({metric: ...}) and ``published_n`` if the published table has such a row.

    (task, kind, name) is (``task3``, ``groups``, ``Slow``), (``task2``, ``controllers``, ``pid``) or (``task1``,
    ``models``, ``naive``).
    """
    found = published()[task][kind].get(name)
    if found is None:
        return row
    metrics = {key: value for key, value in found.items() if key != "n"}
    return {**row, "published": metrics, "published_n": found.get("n")}

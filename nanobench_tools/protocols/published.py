"""The published tables, read from ``published.toml`` beside this file, and put into the rows they belong to."""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any


@functools.cache
def published() -> dict[str, Any]:
    """{task1, task2, task3} as in published.toml: metrics in SI, {mean, std} over flights (task 1: by horizon)."""
    return tomllib.loads((Path(__file__).with_name("published.toml")).read_text(encoding="utf-8"))


def least_sum(by_horizon: Mapping[str, float]) -> float:
    """The least that errors which never shrink with the horizon add up to over h = 1..H, from the published horizons.

    >>> least_sum({"1": 1.0, "3": 5.0})  # 1 + 1 + 5
    7.0
    """
    steps = sorted((int(h), error) for h, error in by_horizon.items())
    until = [h for h, _ in steps[1:]] + [steps[-1][0] + 1]
    return float(sum(error * (end - h) for (h, error), end in zip(steps, until, strict=True)))


def beside(row: dict[str, Any], task: str, kind: str, name: str) -> dict[str, Any]:
    """``row`` with keys ``published`` ({metric: ...}; of Task 1, whose sums are in no released
    file, with the least they can be, ``sum_at_least``) and ``published_n`` if the published table has such a row.

    (task, kind, name) is (``task3``, ``groups``, ``Slow``), (``task2``, ``controllers``, ``pid``) or (``task1``,
    ``models``, ``naive``).
    """
    found = published()[task][kind].get(name)
    if found is None:
        return row
    metrics = {key: {**value, "sum_at_least": least_sum(value)} if task == "task1" and "sum" not in value else value
               for key, value in found.items() if key != "n"}
    return {**row, "published": metrics, "published_n": found.get("n")}

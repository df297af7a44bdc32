"""The published tables, read from ``published.toml`` beside this file, and put into the rows they belong to."""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..result import OPTIONAL, Result
from .least_sum import least_sum


@dataclass(frozen=True, repr=False)
class MeanStd(Result):
    """A published score over flights, SI."""

    mean: float
    std: float | None = field(default=None, metadata=OPTIONAL)


@dataclass(frozen=True, repr=False)
class Published(Result):
    """A published row beside ours: by metric a MeanStd; of Task 1 {horizon: error}, and as its sums are in no released
    file, the least they can be, ``sum_at_least``. published_n: flights."""

    published: Mapping[str, Any]
    published_n: int | None


RATE, ATTITUDE = "rate_mae_rad_s", "attitude_mae_rad"


@functools.cache
def published() -> dict[str, Any]:
    """{task1, task2, task3} as in published.toml: metrics in SI, {mean, std} over flights (task 1: by horizon)."""
    return tomllib.loads((Path(__file__).with_name("published.toml")).read_text(encoding="utf-8"))


def beside(task: str, kind: str, name: str) -> Published | None:
    """The published row of (task, kind, name), if the published table has it: (``task3``, ``groups``, ``Slow``),
    (``task2``, ``controllers``, ``pid``) or (``task1``, ``models``, ``naive``)."""
    found = published()[task][kind].get(name)
    if found is None:
        return None
    metrics = {key: value for key, value in found.items() if key not in ("n", "holds")}
    if task == "task1":
        return Published({key: {**value, "sum_at_least": _least_sum(found, key)} for key, value in metrics.items()},
                         found.get("n"))
    return Published({key: MeanStd(**value) for key, value in metrics.items()}, found.get("n"))


def _least_sum(row: Mapping[str, Any], metric: str) -> float:
    """Of one metric of a published row of Task 1, by what the row says that it holds."""
    turning = row[RATE]["50"] if metric == ATTITUDE and RATE in row["holds"] else None
    held = metric in row["holds"]
    return least_sum(row[metric], held, None if held else turning)

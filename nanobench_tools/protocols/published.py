"""The published tables, read from ``published.toml`` in this folder, and put into the rows they belong to."""

import functools
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..flight import Flight
from ..results.result import OPTIONAL, Result

FORMAT = "nanobench"
"""Source of the recordings of which the tables were published."""


@dataclass(frozen=True, repr=False)
class MeanStd(Result):
    """A published score over flights, SI."""

    mean: float
    std: float | None = field(default=None, metadata=OPTIONAL)


@dataclass(frozen=True, repr=False)
class Published(Result):
    """A published row for comparison with ours: by metric a MeanStd. Of Task 1 it has the error after {1, 10, 50}
    steps and their ``sum`` over 1..50.

    published_n: flights."""

    published: Mapping[str, Any]
    published_n: int | None


@functools.cache
def published() -> dict[str, Any]:
    """{task1, task2, task3} as in published.toml: metrics in SI, {mean, std} over flights (task 1: by horizon)."""
    return tomllib.loads((Path(__file__).with_name("published.toml")).read_text(encoding="utf-8"))


def may_be_published(flights: Iterable[Flight]) -> bool:
    """Whether a real recording in the format of the published ones is among these."""
    return any(f.provenance.source == FORMAT and not f.provenance.synthetic for f in flights)


def beside(task: str, kind: str, name: str) -> Published | None:
    """The published row of (task, kind, name), if the published table has it.

    Such are (task3, groups, Slow), (task2, controllers, pid) and (task1, models, naive)."""
    found = published()[task][kind].get(name)
    if found is None:
        return None
    metrics = {key: value if task == "task1" else MeanStd(**value) for key, value in found.items() if key != "n"}
    return Published(metrics, found.get("n"))

"""Runs items (method x flight): in process, on the cores of this machine, or on a cluster; the same result each time.

A finished item is in the store before the next is counted, so a killed run goes on where it was. One failing item
is reported and does not stop the others.
"""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..flight import Flight
from .items import Item, Results, execute
from .progress import Progress
from .store import Store


@dataclass(frozen=True)
class RunResult:
    """``values``: key -> what the function gave, in the order of the items, failed ones left out; ``failed``: [{item,
    file, error}] in the same order; ``executed``: how many were not answered from the store."""

    values: dict[str, Any]
    failed: list[dict[str, str]]
    executed: int = 0


def run_items(items: Sequence[Item], store_dir: Path | None = None, jobs: int = 1, scheduler: str | None = None,
              progress: Progress | None = None, title: str = "items") -> RunResult:
    """Run ``items`` and return values and failures in the order of the items, for any order of execution.

    ``jobs``: processes on this machine, 1 is this process. ``scheduler``: address of a Dask scheduler
    (tcp://host:port), then ``jobs`` does not count. ``store_dir``: finished items are looked up and written there.
    Raises MissingExtraError or UsageError for a scheduler that cannot be used. KeyboardInterrupt passes through, and
    finished items are kept.
    """
    store = Store(store_dir) if store_dir is not None else None
    unique = {item.key: item for item in items}
    values: dict[str, dict[str, Any]] = {}
    if store is not None:
        values = {key: value for key in unique if (value := store.get(key)) is not None}
    pending = [item for key, item in unique.items() if key not in values]
    errors: dict[str, str] = {}
    with (progress or Progress(quiet=True)).task(title, len(unique)) as step, \
            closing(_results(pending, store, jobs, scheduler)) as results:
        step(len(values))
        for item, outcome in results:
            if outcome.value is not None:
                values[item.key] = outcome.value
            else:
                errors[item.key] = outcome.error or "no result"
            step(len(values) + len(errors), len(errors))
    failed = [{"item": item.label, "file": _file_of(item), "error": errors[key]}
              for key, item in unique.items() if key in errors]
    return RunResult({key: item.read(values[key]) for key, item in unique.items() if key in values}, failed,
                     len(pending))


def _results(pending: list[Item], store: Store | None, jobs: int, scheduler: str | None) -> Results:
    """Picks who does the work. Modules of the pools are loaded only when used: they cost more than small runs."""
    if scheduler is not None:
        from .cluster import run_on_cluster

        return run_on_cluster(pending, store, scheduler)
    if jobs > 1 and len(pending) > 1:
        from .pool import run_on_pool

        return run_on_pool(pending, store, min(jobs, len(pending)))
    return ((item, execute(item, store)) for item in pending)


def _file_of(item: Item) -> str:
    """The input of an item: its own statement, else the first argument that is a flight or a path."""
    if item.file:
        return item.file
    for value in item.kwargs.values():
        if isinstance(value, Flight):
            return value.provenance.path
        if isinstance(value, Path):
            return str(value)
        if isinstance(getattr(value, "path", None), (str, Path)):
            return str(value.path)
    return ""

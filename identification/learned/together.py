"""Several trainings side by side, each on one core, with one account of how far they are.

A training is the same in whichever process it runs. Each keeps its own checkpoint, so a killed lot goes on where every
one of them was.
"""

from __future__ import annotations

import json
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .bar import Step, bars
from .training import Trained

LOOK_S = 0.5
"""How often the account is brought up to date."""


@dataclass(frozen=True)
class Work:
    """One training: ``function(**kwargs, report=step)`` of a module gives a Trained; epochs that it will have done."""

    label: str
    function: Callable[..., Trained]
    kwargs: Mapping[str, Any]
    epochs: int


def train_together(work: Sequence[Work], jobs: int = 1,
                   quiet: bool = True) -> tuple[dict[str, Trained], dict[str, str]]:
    """(trainings, why one failed) by label; ``jobs`` at a time. The longest had better come first."""
    from nanobench_tools.harness import make_item, run_items

    with tempfile.TemporaryDirectory(prefix="nanobench-learned-") as folder:
        notes = {one.label: Path(folder) / f"{i}.json" for i, one in enumerate(work)}
        items = [make_item(_one, {"function": one.function, "kwargs": dict(one.kwargs), "note": notes[one.label]},
                           one.label) for one in work]
        with _watched({one.label: (one.epochs, notes[one.label]) for one in work}, jobs, quiet):
            done = run_items(items, None, jobs)
    failed = {one["item"]: one["error"] for one in done.failed}
    return {item.label: Trained.of(done.values[item.key]) for item in items if item.key in done.values}, failed


def _one(function: Callable[..., Trained], kwargs: Mapping[str, Any], note: Path) -> dict[str, Any]:
    report = _noted(note)
    found = function(**kwargs, report=report)
    report(len(found.history), *found.history[-1])  # one that a checkpoint held whole told of no epoch
    return asdict(found)


def _noted(path: Path) -> Step:
    """Writes every epoch into a file, whole or not at all, for the process that shows it."""
    def step(done: int, loss: float, valid: float) -> None:
        path.with_suffix(".new").write_text(json.dumps([done, float(loss), float(valid)]))
        path.with_suffix(".new").replace(path)

    return step


@contextmanager
def _watched(notes: Mapping[str, tuple[int, Path]], jobs: int, quiet: bool) -> Iterator[None]:
    """Shows what the notes {label: (epochs, path)} say until the block ends."""
    if quiet or not notes:
        yield
        return
    ended = threading.Event()

    def show() -> None:
        with bars({label: epochs for label, (epochs, _) in notes.items()}, jobs) as step:
            while not ended.wait(LOOK_S):
                step({label: json.loads(path.read_text()) for label, (_, path) in notes.items() if path.exists()})

    thread = threading.Thread(target=show, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()

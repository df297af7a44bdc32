"""Progress of a training on stderr: epoch, loss, validation loss, time left."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Step = Callable[[int, float, float], None]
PERIOD_S = 10.0


@contextmanager
def bar(label: str, epochs: int, quiet: bool, begun: int = 0) -> Iterator[Step]:
    """A bar of ``epochs``, of which ``begun`` were done before: call it with (epochs done, loss, validation loss)."""
    if quiet:
        yield lambda done, loss, valid: None
    elif sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
                   TextColumn("{task.fields[loss]}"), TextColumn("left"), TimeRemainingColumn())
        with Progress(*columns, console=Console(stderr=True), transient=True) as bars:
            task = bars.add_task(label, total=epochs, completed=begun, loss="")
            yield lambda done, loss, valid: bars.update(task, completed=done, loss=_losses(loss, valid))
    else:
        started = last = time.monotonic()

        def step(done: int, loss: float, valid: float) -> None:
            nonlocal last
            now = time.monotonic()
            if now - last < PERIOD_S and done < epochs:
                return
            last = now
            left = round((now - started) / max(done - begun, 1) * (epochs - done))
            print(f"{label}: epoch {done} of {epochs}, {_losses(loss, valid)}, about {left // 60}:{left % 60:02d} left",
                  file=sys.stderr, flush=True)

        yield step


def _losses(loss: float, valid: float) -> str:
    return f"loss {loss:.3g} (validation {valid:.3g})"

"""Progress on stderr: how many of how many, failures, time left. Silent when asked; plain lines into a file."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol, TextIO

PLAIN_PERIOD_S = 10.0
"""How often a plain line is written when stderr is not a terminal."""


class Task(Protocol):
    """One bar: call it with the number done so far, how many of these failed, and the total if it became known."""

    def __call__(self, done: int, failed: int = 0, total: int | None = None) -> None: ...


class Progress:
    """Opens bars. ``quiet`` shows nothing; a terminal gets a live bar, anything else a plain line now and then."""

    def __init__(self, quiet: bool = False, file: TextIO | None = None, period_s: float = PLAIN_PERIOD_S) -> None:
        self.quiet, self.file, self.period_s = quiet, file or sys.stderr, period_s

    @contextmanager
    def task(self, label: str, total: int) -> Iterator[Task]:
        """A bar of ``total`` steps, gone or finished when the block ends."""
        if self.quiet or total == 0:
            yield lambda done, failed=0, total=None: None
        elif self.file.isatty():
            with self._live(label, total) as task:
                yield task
        else:
            yield self._plain(label, total)

    @contextmanager
    def _live(self, label: str, total: int) -> Iterator[Task]:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
        from rich.progress import Progress as RichProgress

        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
                   TextColumn("left"), TimeRemainingColumn(), TextColumn("{task.fields[failures]}"))
        with RichProgress(*columns, console=Console(file=self.file), transient=True) as bars:
            bar = bars.add_task(label, total=total, failures="")

            def step(done: int, failed: int = 0, total: int | None = None) -> None:
                bars.update(bar, completed=done, total=total, failures=f"{failed} failed" if failed else "")

            yield step

    def _plain(self, label: str, all_steps: int) -> Task:
        started = last = time.monotonic()

        def step(done: int, failed: int = 0, total: int | None = None) -> None:
            nonlocal last
            total = total or all_steps
            now = time.monotonic()
            if now - last < self.period_s or not done:
                return
            last = now
            left = (now - started) / done * (total - done)
            failures = f", {failed} failed" if failed else ""
            print(f"{label}: {done} of {total}{failures}, about {_clock(left)} left", file=self.file, flush=True)

        return step


def _clock(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    return f"{minutes}:{seconds:02d}"

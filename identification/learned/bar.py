"""Progress of trainings on stderr, of one or of several side by side: epoch, loss, validation loss, time left."""

import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

Step = Callable[[int, float, float], None]
PERIOD_S = 10.0


@contextmanager
def bar(label: str, epochs: int, quiet: bool, begun: int = 0) -> Iterator[Step]:
    """A bar of ``epochs``, of which ``begun`` were done before: call it with (epochs done, loss, validation loss)."""
    if quiet:
        yield lambda done, loss, valid: None
    elif sys.stderr.isatty():
        with _live() as shown:
            task = shown.add_task(label, total=epochs, completed=begun, loss="")
            yield lambda done, loss, valid: shown.update(task, completed=done, loss=_losses(loss, valid))
    else:
        started = last = time.monotonic()

        def step(done: int, loss: float, valid: float) -> None:
            nonlocal last
            now = time.monotonic()
            if now - last < PERIOD_S and done < epochs:
                return
            last = now
            left = (now - started) / max(done - begun, 1) * (epochs - done)
            print(f"{label}: epoch {done} of {epochs}, {_losses(loss, valid)}, about {_clock(left)} left",
                  file=sys.stderr, flush=True)

        yield step


Several = Callable[[Mapping[str, Sequence[float]]], None]


@contextmanager
def bars(epochs: Mapping[str, int], jobs: int) -> Iterator[Several]:
    """Trainings {label: epochs}, ``jobs`` at a time: call it with {label: (epochs done, loss, validation loss)} of
    those that have begun. A terminal gets a bar for each that runs, anything else one line for all now and then."""
    left = Left(epochs, jobs)
    if sys.stderr.isatty():
        with _live() as shown:
            whole = shown.add_task("trainings", total=len(epochs), loss="")
            tasks = {label: shown.add_task(label, total=total, loss="", visible=False) for label, total in
                     epochs.items()}

            def draw(states: Mapping[str, Sequence[float]]) -> None:
                remains = left(states, time.monotonic())
                for label, (done, loss, valid) in states.items():
                    shown.update(tasks[label], completed=done, loss=_losses(loss, valid),
                                 visible=done < epochs[label])
                shown.update(whole, completed=sum(state[0] >= epochs[label] for label, state in states.items()),
                             loss="" if remains is None else f"about {_clock(remains)} in all")

            yield draw
        return
    last = time.monotonic()

    def tell(states: Mapping[str, Sequence[float]]) -> None:
        nonlocal last
        now = time.monotonic()
        remains = left(states, now)
        if now - last < PERIOD_S or remains is None:
            return
        last = now
        running = [f"{label} epoch {done:.0f} of {epochs[label]}, {_losses(loss, valid)}"
                   for label, (done, loss, valid) in states.items() if done < epochs[label]]
        ended = len(states) - len(running)
        print("; ".join([*running, f"{ended} of {len(epochs)} trained, about {_clock(remains)} left"]),
              file=sys.stderr, flush=True)

    yield tell


class Left:
    """Seconds that trainings {label: epochs} will still take, ``jobs`` at a time. One that has not begun is taken to be
    as fast as the others are on average."""

    def __init__(self, epochs: Mapping[str, int], jobs: int) -> None:
        self.epochs, self.jobs = epochs, jobs
        self.first: dict[str, tuple[float, float]] = {}
        self.pace_s: dict[str, float] = {}

    def __call__(self, states: Mapping[str, Sequence[float]], now_s: float) -> float | None:
        """None until one of them has done an epoch more than when it was first seen."""
        for label, (done, *_) in states.items():
            since_s, before = self.first.setdefault(label, (now_s, done))
            if before < done < self.epochs[label]:
                self.pace_s[label] = (now_s - since_s) / (done - before)
        if not self.pace_s:
            return None
        mean_s = sum(self.pace_s.values()) / len(self.pace_s)
        each = [(total - (states[label][0] if label in states else 0)) * self.pace_s.get(label, mean_s)
                for label, total in self.epochs.items()]
        return max(*each, sum(each) / self.jobs) if len(each) > 1 else each[0]


def _live() -> Any:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    return Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
                    TextColumn("{task.fields[loss]}"), TextColumn("left"), TimeRemainingColumn(),
                    console=Console(stderr=True), transient=True)


def _clock(seconds: float) -> str:
    whole = round(seconds)
    return f"{whole // 60}:{whole % 60:02d}"


def _losses(loss: float, valid: float) -> str:
    return f"loss {loss:.3g} (validation {valid:.3g})"

"""Settings of the whole program that several flights need at once: each begins them, and they end with the last."""

import functools
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import ParamSpec

P = ParamSpec("P")


def together(make: Callable[P, AbstractContextManager[None]]) -> Callable[P, AbstractContextManager[None]]:
    """Decorate a context that several threads enter: its effects are undone when the last thread leaves."""
    entered: list[AbstractContextManager[None]] = []
    inside, lock = [0], threading.Lock()

    @contextmanager
    def shared(*given: P.args, **named: P.kwargs) -> Iterator[None]:
        with lock:
            context = make(*given, **named)
            context.__enter__()
            entered.append(context)
            inside[0] += 1
        try:
            yield
        finally:
            with lock:
                inside[0] -= 1
                while entered and not inside[0]:
                    entered.pop().__exit__(None, None, None)

    return functools.wraps(make)(shared)

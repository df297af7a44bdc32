"""Waits that end: a call that is given up after a time, and the end of a program that cannot end itself."""

import faulthandler
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from .several_flights import together

STDERR = 2
POSIX = hasattr(signal, "setitimer")


def within(seconds: float, call: Callable[[], object], name: str) -> bool:
    """Whether ``call`` ended in time. It runs in a separate thread, which is left alone if it does not; raises what
    the call raises until then."""
    raised: list[BaseException] = []

    def run() -> None:
        try:
            call()
        except BaseException as error:  # handed on to who asked
            raised.append(error)

    thread = threading.Thread(target=run, name=name, daemon=True)
    thread.start()
    thread.join(seconds)
    if raised:
        raise raised[0]
    return not thread.is_alive()


def renew(seconds: float) -> None:
    """Within ``last_resort``: the program has so long from now on."""
    if POSIX:
        signal.setitimer(signal.ITIMER_REAL, seconds)


@together
@contextmanager
def last_resort(seconds: float) -> Iterator[None]:
    """If a program is still within the ``with`` after this time, the system ends it (SIGALRM). The place of its
    threads is written to stderr. No thread and no interpreter is needed for it: foreign code that holds the
    interpreter for ever ends, too. Not on Windows, and not where somebody uses that signal."""
    if not POSIX or signal.getsignal(signal.SIGALRM) is not signal.SIG_DFL:
        yield
        return
    faulthandler.register(signal.SIGALRM, file=STDERR, all_threads=True, chain=True)
    renew(seconds)
    try:
        yield
    finally:
        renew(0.0)
        faulthandler.unregister(signal.SIGALRM)


def end_at_once(why: str) -> None:
    """Ends the program without asking anybody: exit code 1, one line on stderr."""
    os.write(STDERR, f"nanobench: {why}\n".encode())
    os._exit(1)

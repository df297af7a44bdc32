"""Items on the cores of this machine: fresh processes from joblib's loky, one numerical thread each."""

from __future__ import annotations

import os
import signal
import threading
import time
import warnings
from collections import deque
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from functools import cache
from multiprocessing import resource_tracker
from typing import Any

from joblib.externals.loky import ProcessPoolExecutor
from joblib.externals.loky.backend import resource_tracker as locks
from joblib.externals.loky.process_executor import BrokenProcessPool

from .items import Item, Outcome, Results, execute
from .store import Store

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
"""Processes already fill the cores."""

WATCH_PERIOD_S = 0.5


def run_on_pool(pending: list[Item], store: Store | None, jobs: int) -> Results:
    """Yield (item, outcome) as they come. The worker stores a value before this process gets it.

    When a worker dies (killed, crashed, out of memory) the pool is lost with it. Unfinished items then run one at a
    time, so that the one that kills its worker is known and fails alone.
    """
    left = {item.key: item for item in pending}
    for item, outcome in _round(pending, store, jobs):
        left.pop(item.key)
        yield item, outcome
    for item in left.values():
        alone = list(_round([item], store, 1))
        yield alone[0] if alone else (item, Outcome(error="the worker process died (killed, crashed or out of memory)"))


def _round(items: list[Item], store: Store | None, jobs: int) -> Results:
    """As many results as there are before the pool breaks. Two items per worker wait in the pool, so that an
    interrupt finds nothing else queued."""
    pool = _take(jobs)
    queue = deque(items)
    running: dict[Future[Any], Item] = {}
    sound = False
    try:
        broken = False
        while running or (queue and not broken):
            try:
                with _interrupt_held():  # workers start when something is submitted
                    while queue and not broken and len(running) < 2 * jobs:
                        running[pool.submit(execute, queue[0], store)] = queue[0]
                        queue.popleft()
            except BrokenProcessPool:
                broken = True
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                item = running.pop(future)
                try:
                    outcome = future.result()
                except BrokenProcessPool:
                    broken = True
                    continue
                except Exception as error:
                    outcome = Outcome(error=f"cannot be sent to another process: {_reason(error)}")
                yield item, outcome
        sound = not broken
    finally:
        if not (sound and _shared):
            _close()


_shared = 0
_pool: ProcessPoolExecutor | None = None
_size = 0


@contextmanager
def shared_workers() -> Iterator[None]:
    """Runs inside this block use the same processes, which saves their start. For one command, not for a session in
    which sources are edited between runs: the processes keep what they have imported."""
    global _shared
    _shared += 1
    try:
        yield
    finally:
        _shared -= 1
        if not _shared:
            _close()


def _take(jobs: int) -> ProcessPoolExecutor:
    """The pool of this process if it is large enough, else a new one."""
    global _pool, _size
    if _pool is None or _size < jobs:
        _close()
        _silence_manager()
        _silence_locks()
        _pool = ProcessPoolExecutor(max_workers=jobs, env=ONE_THREAD, initializer=_start_worker,
                                    initargs=(os.getpid(),))
        _size = jobs
    return _pool


@cache
def _silence_manager() -> None:
    """Suppress what the pool's thread says about workers that ended: by this process, or replaced since their memory
    grew. The outcome of an item comes with its future."""
    warnings.filterwarnings("ignore", "A worker stopped while some jobs were given")
    shown = threading.excepthook

    def show(found: threading.ExceptHookArgs) -> None:
        if found.thread is None or not found.thread.name.startswith("ExecutorManagerThread"):
            shown(found)

    threading.excepthook = show


@cache
def _silence_locks() -> None:
    """The process that cleans up locks warns of those that ended workers had; it inherits what it may say."""
    before = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = ",".join(filter(None, [before, "ignore:resource_tracker"]))
    try:
        locks.ensure_running()
    finally:
        os.environ.pop("PYTHONWARNINGS")
        if before is not None:
            os.environ["PYTHONWARNINGS"] = before


def _close() -> None:
    global _pool
    if _pool is not None:
        _pool.shutdown(wait=True, kill_workers=True)
        _pool = None


def _reason(error: Exception) -> str:
    """The line of a pickling error that says why; loky puts it at the end of a traceback in the cause."""
    lines = [line for line in str(error.__cause__ or error).splitlines() if line.strip(' "')]
    return lines[-1].strip() if lines else type(error).__name__


@contextmanager
def _interrupt_held() -> Iterator[None]:
    """Ctrl-C reaches the whole group of processes, but only the first one is to answer and end the others. Processes
    that start in this block never see it; this one gets it when the block ends."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # it would unblock the signal when it starts
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_worker(parent: int) -> None:
    """A worker ends automatically when its first process is gone (killed)."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(WATCH_PERIOD_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()

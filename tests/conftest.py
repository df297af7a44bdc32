"""Fixtures shared by all tests.

Real recordings are never in the repository; tests that need them say when they are absent.
"""

from __future__ import annotations

import fcntl
import gc
import os
import pickle
import signal
import sys
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from practice_crowd import Crowd

    from nanobench_tools.auditing.recording_audit import Audit
    from nanobench_tools.flight import Flight

pytest_plugins = ["leftovers"]

T = TypeVar("T")
REPOSITORY = Path(__file__).resolve().parent.parent
COMPILED = ("kernels", "compiled")
"""Folders of the cache with machine code."""
LEFT_OUT = "a slow proof: make test-slow"

for _threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")  # before NumPy is loaded: every core has a test process of its own
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # else every process of a run translates a thousand files again
sys.dont_write_bytecode = False
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell's background job; what tests start would ignore it, too
    signal.signal(signal.SIGINT, signal.default_int_handler)
os.environ.setdefault("NUMBA_USE_LLVMLITE_MEMORY_MANAGER", "1")  # else LLVM may abort after JAX has mapped its memory


# No deadline: a busy machine is slow, not wrong.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("searching", derandomize=False, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))  # "searching" draws new examples every time


def _real_root() -> Path | None:
    """The folder that holds nanobench/, crazyflie_usd/, ... ; $NANOBENCH_DATA may name it or its nanobench folder."""
    places = [os.environ.get("NANOBENCH_DATA"), REPOSITORY.parent / "shared" / "data"]
    for place in map(Path, filter(None, places)):
        for root in (place, place.parent):
            if (root / "nanobench").is_dir():
                return root
    return None


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Root of the real recordings, with nanobench/, crazyflie_usd/, crazypad/, stand/, firmware_reference/ in it."""
    root = _real_root()
    if root is None:
        pytest.skip("REAL RECORDINGS ABSENT: set NANOBENCH_DATA to run this test")
    return root


def pytest_addoption(parser) -> None:
    parser.addoption("--leave-out-slow", action="store_true", help="skip tests marked slow, and say how many")


def pytest_configure(config) -> None:
    """In a run of all tests each process collects other folders first, and compiles the test files of these."""
    gc.disable()  # until all is collected
    worker = os.environ.get("PYTEST_XDIST_WORKER")
    if worker and config.args == ["tests"]:
        parts = sorted(path for path in Path(__file__).parent.iterdir() if path.is_dir() or path.match("test_*.py"))
        first = int(worker.removeprefix("gw")) * len(parts) // int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
        config.args[:] = [str(path) for path in parts[first:] + parts[:first] if path.name != "__pycache__"]


def pytest_collection_finish() -> None:
    """The garbage collector no longer looks through what was imported and collected."""
    gc.collect()
    gc.freeze()
    gc.enable()


def pytest_collection_modifyitems(config, items) -> None:
    items.sort(key=lambda item: item.path)  # every process must have the same order
    if config.getoption("--leave-out-slow"):
        for item in items:
            if item.get_closest_marker("slow"):
                item.add_marker(pytest.mark.skip(reason=LEFT_OUT))


def _place_of_all(tmp_path_factory) -> Path:
    """The folder of this run that all its test processes share."""
    own = tmp_path_factory.getbasetemp()
    return own.parent if "PYTEST_XDIST_WORKER" in os.environ else own


@pytest.fixture(scope="session")
def made_once(tmp_path_factory) -> Callable[[str, Callable[[], T]], T]:
    """``made_once(name, make)`` -> what ``make()`` gave to the first test process of this run that asked for ``name``.

    For what takes seconds to make and several processes need. Nothing is kept from one run to the next.
    """
    folder = _place_of_all(tmp_path_factory) / "made_once"
    folder.mkdir(exist_ok=True)

    def give(name: str, make: Callable[[], T]) -> T:
        kept = folder / f"{name}.pickle"
        with (folder / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if kept.exists():
                return pickle.loads(kept.read_bytes())
            made = make()
            kept.write_bytes(pickle.dumps(made, pickle.HIGHEST_PROTOCOL))
            return made

    return give


@pytest.fixture(scope="session")
def crowd(made_once) -> Crowd:
    """Practice flights by name (``practice_crowd.VEHICLES``), flown once in a run; they start with the same seeds."""
    from practice_crowd import fly_crowd

    return made_once("crowd", fly_crowd)


@pytest.fixture(scope="session")
def audited(made_once, shared_cache) -> Callable[[Flight], Audit]:
    """``audited(flight)`` -> its audit, made by one test process of this run for all that read the recording under
    whatever name, and left where verbs that write to no folder find it."""

    def give(flight: Flight) -> Audit:
        from nanobench_tools.auditing.recording_audit import Audit
        from nanobench_tools.harness.audits import audit_item
        from nanobench_tools.harness.identity import item_key
        from nanobench_tools.harness.store import Store, encode, user_store
        from nanobench_tools.results.result import from_json

        unnamed = replace(flight, name="recording")
        made = made_once(f"audit_{item_key(audit_item, {'flight': unnamed})}", lambda: encode(audit_item(unnamed)))
        value = {**made, "flight": flight.name}
        Store(user_store()).put(item_key(audit_item, {"flight": flight}), value)
        return from_json(Audit, value)

    return give


def _use_kept_code(cache: Path) -> Path:
    """Gives a cache the compiled models that earlier runs left, found by the hash of all that goes into them."""
    cache.mkdir(parents=True, exist_ok=True)
    for name in COMPILED:
        kept = REPOSITORY / "build" / "tests" / name
        kept.mkdir(mode=0o700, parents=True, exist_ok=True)
        with suppress(FileExistsError):
            (cache / name).symlink_to(kept)
    return cache


@pytest.fixture(scope="session", autouse=True)
def shared_cache(tmp_path_factory):
    """All tests of a run share one cache; nothing is read from or left in the user's."""
    cache = _use_kept_code(_place_of_all(tmp_path_factory) / "cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NANOBENCH_CACHE", str(cache))
        yield cache


@pytest.fixture(scope="session", autouse=True)
def one_core():
    """``--jobs`` is 1 unless a test gives it: every core has a test process, and workers take seconds to start."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "sched_getaffinity", lambda pid: {0}, raising=False)
        yield


@pytest.fixture
def empty_cache(tmp_path):
    """A cache without recordings."""
    return _use_kept_code(tmp_path / "cache")


@pytest.fixture(scope="session", autouse=True)
def compiled_once(tmp_path_factory):
    """What Numba keeps on disk is compiled by one test process; others that need it meanwhile wait and read it."""
    from numba.core.caching import NullCache
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.dispatcher import Dispatcher

    locks = _place_of_all(tmp_path_factory) / "numba_locks"
    locks.mkdir(exist_ok=True)
    compile_now = Dispatcher.compile

    def compile_once(self, signature):
        if isinstance(self._cache, NullCache):
            return compile_now(self, signature)
        function = f"{self.py_func.__module__}.{self.py_func.__qualname__}"
        with global_compiler_lock, (locks / function).open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            return compile_now(self, signature)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Dispatcher, "compile", compile_once)
        yield


def pytest_terminal_summary(terminalreporter) -> None:
    """Says at the end, and not only in a skip count, what was not checked and why."""
    why = Counter(report.longrepr[2].removeprefix("Skipped: ") for report in terminalreporter.stats.get("skipped", []))
    if slow := why.pop(LEFT_OUT, 0):
        terminalreporter.write_line(f"{slow} SLOW PROOFS LEFT OUT: make test-slow runs them")
    for reason, count in why.items():
        terminalreporter.write_line(f"{count} NOT RUN: {reason}")
    if _real_root() is None:
        terminalreporter.write_line("REAL RECORDINGS ABSENT: every test marked 'real' was skipped; set NANOBENCH_DATA")

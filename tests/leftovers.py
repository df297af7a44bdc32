"""At the end of a run: no test leaves a process, a port or a temporary folder behind, and one that does is named.

A pytest plugin that ``conftest.py`` loads. Processes are identified by what they inherit: pytest puts the name of the
running test into the environment. Fixtures end with their test file, so every file is checked when its last test has
ended; processes whose parent is gone are found at the end of the run. Needs /proc; other systems are not checked.
"""

import gc
import os
import re
import shutil
import tempfile
import time
import uuid
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

RUN, TEST = "NANOBENCH_TEST_RUN", "PYTEST_CURRENT_TEST"
"""Variables of the environment: this run, and the running test (set by pytest)."""
PROC = Path("/proc")
TABLES = ("tcp", "tcp6", "udp", "udp6")
WITH_ITS_PARENT = "resource_tracker"
"""Helper process of multiprocessing and loky; it ends when the process that needs it ends."""
PATIENCE_S = 10.0
"""Processes that were told to end may take this long on a busy machine."""


def command(pid: str) -> str:
    """The command line of a process, or its short name when it has ended and was not waited for."""
    words = (PROC / pid / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
    return words[:160] or "ended, not waited for: " + (PROC / pid / "comm").read_text().strip()


def children() -> Iterator[tuple[str, str]]:
    """(key, description) of the child processes of this process, living or not waited for."""
    for task in os.listdir("/proc/self/task"):
        with suppress(OSError), open(f"/proc/self/task/{task}/children") as listed:
            for pid in listed.read().split():
                if WITH_ITS_PARENT not in (words := command(pid)):
                    yield pid, f"process {pid} ({words})"


def sockets() -> Iterator[tuple[str, str]]:
    """(inode, description) of the sockets of this process."""
    for place in os.listdir("/proc/self/fd"):
        with suppress(OSError):
            if found := re.fullmatch(r"socket:\[(\d+)\]", os.readlink(f"/proc/self/fd/{place}")):
                yield found[1], "a port that is still open"


def ports() -> set[str]:
    """Inodes of all sockets that have an internet address."""
    found = set()
    for table in TABLES:
        with suppress(OSError):
            found |= {line.split()[9] for line in (PROC / "net" / table).read_text().splitlines()[1:]}
    return found


class Watch:
    """What exists now and did not before the first test, with the test after which it was there first."""

    def __init__(self) -> None:
        self.temporary = Path(tempfile.mkdtemp(prefix="nanobench-tests-"))
        self.former = os.environ.get("TMPDIR")
        self._use(str(self.temporary))
        self.before = {key for key, _ in self._present()}
        self.first: dict[str, tuple[str, str]] = {}
        self.left: list[str] = []

    @staticmethod
    def _use(folder: str | None) -> None:
        """The folder for temporary files, here and in processes started from here."""
        if folder is None:
            os.environ.pop("TMPDIR", None)
        else:
            os.environ["TMPDIR"] = folder
        tempfile.tempdir = None

    def _present(self) -> Iterator[tuple[str, str]]:
        yield from children()
        yield from sockets()
        for name in os.listdir(self.temporary):
            yield name, f"temporary {name}"

    def after(self, test: str) -> None:
        for key, what in self._present():
            if key not in self.before:
                self.first.setdefault(key, (test, what))

    def judge(self) -> None:
        """Whatever still exists is left behind."""
        if not self.first:
            return
        gc.collect()
        until = time.monotonic() + PATIENCE_S
        while (left := self._left()) and time.monotonic() < until and any(key.isdigit() for key in left):
            time.sleep(0.05)
        self.left += [f"{self.first[key][0]}: {what}" for key, what in left.items()]
        self.before |= set(left)
        self.first.clear()

    def _left(self) -> dict[str, str]:
        internet = ports()
        return {key: what for key, what in self._present()
                if key in self.first and ("port" not in what or key in internet)}

    def close(self) -> None:
        self._use(self.former)
        shutil.rmtree(self.temporary, ignore_errors=True)


def of_this_run() -> list[str]:
    """Processes that a test of this run started and that still exist."""
    found = []
    for place in PROC.glob("[0-9]*"):
        with suppress(OSError):
            pairs = (place / "environ").read_bytes().decode(errors="replace").split("\0")
            variables = dict(pair.partition("=")[::2] for pair in pairs)
            ours = variables.get(RUN) == os.environ[RUN] and TEST in variables and int(place.name) != os.getpid()
            if ours and WITH_ITS_PARENT not in (words := command(place.name)):
                found.append(f"{variables[TEST]}: process {place.name} ({words})")
    return found


WATCH = pytest.StashKey[Watch]()
LEFT = pytest.StashKey[list[str]]()


def pytest_sessionstart(session: pytest.Session) -> None:
    session.config.stash[LEFT] = []
    os.environ.setdefault(RUN, uuid.uuid4().hex)
    if PROC.is_dir():
        session.config._tmp_path_factory.getbasetemp()  # where it would be without this
        session.config.stash[WATCH] = Watch()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
    done = yield
    if watch := item.config.stash.get(WATCH, None):
        watch.after(item.nodeid)
        if nextitem is None or nextitem.path != item.path:
            watch.judge()
    return done


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: object, error: object) -> None:
    """A process of the run has ended and reports what it found."""
    node.config.stash[LEFT] += getattr(node, "workeroutput", {}).get("leftovers", [])  # type: ignore[attr-defined]


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    config = session.config
    left = config.stash[LEFT]
    if watch := config.stash.get(WATCH, None):
        left += watch.left
        watch.close()
    if hasattr(config, "workeroutput"):
        config.workeroutput["leftovers"] = left
        return
    if PROC.is_dir():
        until = time.monotonic() + PATIENCE_S
        while (found := of_this_run()) and time.monotonic() < until:
            time.sleep(0.05)
        left += found
    if left and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    for line in config.stash[LEFT]:
        terminalreporter.write_line(f"LEFT BEHIND by {line}", red=True)

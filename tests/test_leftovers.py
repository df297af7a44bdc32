"""The check at the end of a run names the test that left something behind, and only that."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import leftovers
import pytest

CONFTEST = """
import leftovers
leftovers.PATIENCE_S = 0.2
pytest_plugins = ["leftovers"]
"""
TESTS = """
import os, socket, subprocess, sys, tempfile, pytest
kept = []

def test_nothing(tmp_path):
    subprocess.run([sys.executable, "-c", ""])
    with tempfile.TemporaryDirectory(), socket.create_server(("127.0.0.1", 0)):
        pass

@pytest.fixture(scope="module")
def until_the_end():
    with subprocess.Popen(["sleep", "20"]) as process:
        yield
        process.kill()

def test_a_fixture_of_the_file(until_the_end):
    pass

def test_child():
    kept.append(subprocess.Popen(["sleep", "20"], stdin=subprocess.PIPE))

def test_not_waited_for():
    kept.append(subprocess.Popen([sys.executable, "-c", ""]))
    kept[-1].wait = lambda timeout=None: 0

def test_port():
    kept.append(socket.create_server(("127.0.0.1", 0)))

def test_folder():
    tempfile.mkdtemp()

def test_orphan():
    subprocess.run(["/bin/sh", "-c", "sleep 20 </dev/null >/dev/null 2>&1 &"])
"""


@pytest.mark.skipif(not leftovers.PROC.is_dir(), reason="NO /proc: processes cannot be listed")
@pytest.mark.parametrize("processes", ["0", "1"])
def test_who_leaves_something_behind_is_named(tmp_path, processes):
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_inner.py").write_text(TESTS)
    env = {name: value for name, value in os.environ.items()
           if name not in (leftovers.RUN, leftovers.TEST) and not name.startswith("PYTEST_XDIST")}
    env["PYTHONPATH"] = str(Path(__file__).parent)
    command = [sys.executable, "-m", "pytest", "-q", "-n", processes, "-p", "no:cacheprovider", "-p",
               "no:hypothesispytest", "--basetemp", tmp_path / "base", "--rootdir", tmp_path, tmp_path]
    done = subprocess.run(command, env=env, text=True, capture_output=True, cwd=tmp_path)
    found = re.findall(r"LEFT BEHIND by test_inner\.py::(\w+).*?: (process|a port|temporary)(?: (\d+))?", done.stdout)
    for _, what, number in found:
        if what == "process":
            try:
                os.kill(int(number), signal.SIGKILL)
            except ProcessLookupError:
                continue
    assert sorted({(test, what) for test, what, _ in found}) == [
        ("test_child", "process"), ("test_folder", "temporary"), ("test_not_waited_for", "process"),
        ("test_orphan", "process"), ("test_port", "a port")], done.stdout
    assert "7 passed" in done.stdout
    assert done.returncode == 1

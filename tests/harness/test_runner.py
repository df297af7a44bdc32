"""The runner: the same result for any number of processes and order, failures that stay alone, nothing lost."""

import os
import random
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
from harness_work import GATED, Scored, fail, score, scores, typed

from nanobench_tools import MissingExtraError
from nanobench_tools.harness import Progress, make_item, run_items
from nanobench_tools.harness.store import Store


def as_text(result) -> str:
    return repr((list(result.values.items()), result.failed))


def test_values_are_those_of_the_function_as_json_types():
    item = make_item(score, {"seed": 3}, "score 3")
    value = run_items([item]).values[item.key]
    expected = score(3)
    assert value["mean"] == expected["mean"]
    assert value["by"] == {"3": expected["by"][3].tolist()}
    assert np.isnan(value["nan"])
    assert value["span"] == [0.0, 3]


def test_a_dataclass_comes_back_as_one_fresh_and_from_the_store(tmp_path):
    item = make_item(typed, {"seed": 3}, "typed")
    for _ in range(2):
        value = run_items([item], tmp_path).values[item.key]
        assert isinstance(value, Scored)
        assert value.by == (3, 1)
        assert np.isnan(value.mean_m)


def test_same_result_for_any_number_of_processes_and_order(tmp_path):
    items = [*scores(8), make_item(fail, {"path": Path("a.csv"), "how": "input"}, "bad")]
    alone = run_items(items)
    shuffled = random.Random(1).sample(items, len(items))
    pool = run_items(shuffled, tmp_path, jobs=2)
    again = run_items(items, tmp_path, jobs=2)
    assert {k: repr(v) for k, v in pool.values.items()} == {k: repr(v) for k, v in alone.values.items()}
    assert as_text(again) == as_text(alone)
    assert (alone.executed, pool.executed, again.executed) == (9, 9, 1)


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_one_failure_is_one_line_and_the_others_go_on(jobs, tmp_path):
    bad = [make_item(fail, {"path": Path("bad.csv"), "how": how}, how) for how in ("input", "other", "type")]
    result = run_items([*scores(2), *bad, *scores(4)[2:]], tmp_path, jobs=jobs)
    assert len(result.values) == 4
    assert [(f["item"], f["file"]) for f in result.failed] == [("input", "bad.csv"), ("other", "bad.csv"),
                                                               ("type", "bad.csv")]
    assert result.failed[0]["error"] == "bad.csv: holds no numbers; give another"
    assert result.failed[1]["error"].startswith("ZeroDivisionError: division by zero (in fail, harness_work.py:")
    assert "builtins.object" in result.failed[2]["error"]
    assert all("\n" not in f["error"] for f in result.failed)
    assert len(list(tmp_path.iterdir())) == 4


@pytest.mark.slow
def test_an_item_that_kills_its_process_fails_alone(tmp_path):
    killer = make_item(fail, {"path": Path("x.csv"), "how": "die"}, "killer")
    result = run_items([*scores(3), killer, *scores(6)[3:]], tmp_path, jobs=2)
    assert len(result.values) == 6
    assert [f["item"] for f in result.failed] == ["killer"]
    assert "died" in result.failed[0]["error"]


@pytest.mark.slow
def test_arguments_that_cannot_travel_are_a_failure_of_their_item():
    unsendable = make_item(score, {"seed": 1}, "generator")
    unsendable = type(unsendable)("k", score, {"seed": (i for i in ())}, "generator")
    result = run_items([unsendable, *scores(2)], jobs=2)
    assert len(result.values) == 2
    assert "generator" in result.failed[0]["error"]


@pytest.mark.parametrize("damage", [b"", b"{}", b"\xff\xfe", b'{"key": 1}\n{}', None, "flip", "cut"])
def test_a_corrupt_store_file_is_done_again(tmp_path, damage):
    items = scores(2)
    first = run_items(items, tmp_path)
    path = Store(tmp_path).path(items[0].key)
    data = path.read_bytes()
    if damage is None:
        path.unlink()
        path.mkdir()
        path.rmdir()
    else:
        path.write_bytes({"flip": data.replace(b"20000", b"20001"), "cut": data[:-20]}.get(damage, damage)
                         if isinstance(damage, str) else damage)
    second = run_items(items, tmp_path)
    assert second.executed == 1
    assert as_text(second) == as_text(first)
    assert path.read_bytes() == data


def stored(folder: Path) -> list[str]:
    return [path.stem for path in folder.glob("*.json")]


WAITED_S = 120.0
"""For what a busy machine does late."""


@contextmanager
def held(tmp_path, jobs):
    """(process, command) of a run of 20 items, of which those from the ninth on wait for a gate that is closed."""
    command = [sys.executable, str(Path(__file__).with_name("harness_work.py")), str(tmp_path / "store"),
               str(tmp_path / "log"), jobs, str(tmp_path / "gate")]
    (tmp_path / "log").touch()
    here = Path(__file__).parent
    with subprocess.Popen(command, start_new_session=True, cwd=here, stderr=subprocess.PIPE) as process:
        try:
            assert comes_to(lambda: len(stored(tmp_path / "store")) >= GATED)
            yield process, command
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def comes_to(done) -> bool:
    until = time.monotonic() + WAITED_S
    while not done() and time.monotonic() < until:
        time.sleep(0.01)
    return bool(done())


@pytest.mark.parametrize("jobs", ["1", pytest.param("2", marks=pytest.mark.slow)])
def test_kill_9_loses_no_finished_item_and_leaves_nothing_half_written(tmp_path, jobs):
    store, log = tmp_path / "store", tmp_path / "log"
    with held(tmp_path, jobs) as (process, command):
        os.killpg(process.pid, signal.SIGKILL)
    finished = stored(store)
    assert len(finished) == GATED
    assert all(Store(store).get(key) is not None for key in finished)
    before = log.read_text().split()
    (tmp_path / "gate").touch()
    resumed = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).parent, check=True)
    assert resumed.stdout.split() == [str(20 - len(finished)), "20"]
    after = log.read_text().split()
    assert len(after) - len(before) == 20 - len(finished)
    assert set(map(int, after)) == set(range(20))
    assert sorted(p.suffix for p in store.iterdir()) == [".json"] * 20


def living(group: int) -> list[str]:
    """Processes of a group that still run (one that ended and is not yet collected does not count)."""
    fields = [path.read_text().rpartition(")")[2].split() for path in Path("/proc").glob("[0-9]*/stat")]
    return [f[0] for f in fields if int(f[2]) == group and f[0] not in "ZX"]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="NO /proc: processes cannot be listed")
@pytest.mark.slow
def test_workers_end_when_only_the_first_process_is_killed(tmp_path):
    store = tmp_path / "store"
    with held(tmp_path, "2") as (process, _):
        assert len(living(process.pid)) > 2
        process.kill()
        process.wait()
        assert comes_to(lambda: not living(process.pid))
    assert all(Store(store).get(key) is not None for key in stored(store))


@pytest.mark.parametrize("jobs", ["1", pytest.param("2", marks=pytest.mark.slow)])
@pytest.mark.slow
def test_ctrl_c_ends_the_run_and_keeps_what_was_done(tmp_path, jobs):
    with held(tmp_path, jobs) as (process, _):
        os.killpg(process.pid, signal.SIGINT)
        _, stderr = process.communicate(timeout=WAITED_S)
        assert comes_to(lambda: not living(process.pid))
    assert process.returncode != 0
    assert b"KeyboardInterrupt" in stderr  # the script does not catch it; the command line does, and says one line
    assert len(stored(tmp_path / "store")) == GATED


def test_a_missing_cluster_package_says_which_extra_brings_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match=r'pip install .*\[cluster\]"'):
        run_items(scores(1), scheduler="tcp://127.0.0.1:8786")


def test_progress_counts_and_is_silent_when_asked(capsys):
    run_items(scores(3), progress=Progress(period_s=0.0), title="scores")
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1].startswith("scores: 3 of 3, about 0:00 left")
    run_items(scores(3), progress=Progress(quiet=True))
    out = capsys.readouterr()
    assert out.err == out.out == ""


def test_progress_on_a_terminal_shows_count_and_time_left():
    import io

    class Terminal(io.StringIO):
        def isatty(self):
            return True

    terminal = Terminal()
    with Progress(file=terminal).task("flights", 4) as step:
        step(3, 1)
    assert "flights" in terminal.getvalue()
    assert "3/4" in terminal.getvalue()
    assert "1 failed" in terminal.getvalue()


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_method_that_ends_the_program_fails_alone(jobs):
    items = [make_item(fail, {"path": Path("x.csv"), "how": "exit"}, "leaver"), *scores(3)]
    result = run_items(items, jobs=jobs)
    assert len(result.values) == 3
    assert [f["item"] for f in result.failed] == ["leaver"]
    assert result.failed[0]["error"].startswith("SystemExit: 3 (in fail, ")

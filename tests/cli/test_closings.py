"""How verbs end: the result, and a next command that works when it is pasted. And ``nanobench new``."""

import importlib
import json
import shlex
import subprocess
import sys

import click
import pytest

from nanobench_tools.cli.closing import WORDS, again
from nanobench_tools.cli.new import KINDS


def next_command(out):
    """The words of the one ``Next, why: command`` line, which is the last."""
    (line,) = [line for line in out.splitlines() if line.startswith("Next, ")]
    assert out.splitlines()[-1] == line
    return shlex.split(line.partition(": ")[2])


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("kind", KINDS)
def test_what_new_writes_passes_its_test(nanobench, here, kind, monkeypatch):
    code, out, err = nanobench("new", kind, "thing_of_mine")
    assert (code, err) == (0, "")
    assert sorted(path.name for path in here.iterdir()) == ["test_thing_of_mine.py", "thing_of_mine.py"]
    words = next_command(out)
    assert words[-1] == "thing_of_mine:ThingOfMine"
    assert words[:2] == ["nanobench", KINDS[kind][2][0]]
    assert nanobench("new", kind, "thing_of_mine")[0] == 2  # nothing is overwritten
    tests = own_tests(here, "thing_of_mine", monkeypatch)
    assert len(tests) == 2
    for test in tests.values():
        test()


def own_tests(folder, name, patch):
    """The test functions that ``nanobench new`` wrote, imported here: a pytest of their own costs seconds."""
    patch.syspath_prepend(folder)
    try:
        found = vars(importlib.import_module(f"test_{name}"))
        return {test: call for test, call in found.items() if test[:5] == "test_"}
    finally:
        for module in (name, f"test_{name}"):
            sys.modules.pop(module, None)


@pytest.mark.slow
def test_the_command_that_new_names_runs_its_test(nanobench, here):
    said = nanobench("new", "estimator", "timed")[1]
    assert "its test: python -m pytest test_timed.py" in said
    done = subprocess.run([sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "test_timed.py"], cwd=here,
                          capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout
    assert "2 passed" in done.stdout


def test_the_test_that_new_writes_can_fail(nanobench, here, monkeypatch):
    nanobench("new", "estimator", "cheat")
    path = here / "cheat.py"
    path.write_text(path.read_text().replace('side="right") - 1', 'side="right").clip(max=len(mocap) - 1)'))
    tests = own_tests(here, "cheat", monkeypatch)
    tests["test_it_is_where_the_vehicle_is"]()
    with pytest.raises(AssertionError):
        tests["test_it_knows_nothing_of_the_future"]()


@pytest.mark.parametrize(("arguments", "says"), [
    (["estimater", "mine"], "unknown kind 'estimater'; did you mean 'estimator'?"),
    (["estimator", "MyEstimator"], "did you mean 'my_estimator'?"),
    (["estimator", "my-estimator.py"], "did you mean 'my_estimator'?"),
    (["estimator", "numpy"], "'numpy' is the name of a package that is installed"),
    (["estimator", "class"], "'class' is no name for a module")])
def test_names_that_cannot_be_are_refused(nanobench, here, arguments, says):
    code, out, err = nanobench("new", *arguments)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert says in err
    assert not list(here.iterdir())


def test_an_estimator_from_new_is_scored_by_the_command_it_names(nanobench, here, recordings, monkeypatch):
    monkeypatch.syspath_prepend(here)
    monkeypatch.delenv("NANOBENCH_DATA", raising=False)
    words = next_command(nanobench("new", "estimator", "first_of_mine")[1])
    given = [recordings if word == "FLIGHTS" else word for word in words[1:]]
    assert recordings in given
    code, out, _ = nanobench(*given, "--jobs", 1, "--json", "e.json")
    assert code == 0
    rows = json.loads((here / "e.json").read_text())["rows"]
    assert {row["method"] for row in rows} > {"first_of_mine", "onboard_ekf"}
    assert "aided: " in out
    assert "smallest ATE " in out
    assert next_command(out)[:2] == ["nanobench", "estimate"]
    assert next_command(out)[-2:] == ["--out", "results"]


def test_the_chain_from_the_first_audit_on_can_be_pasted(nanobench, here, recordings):
    """Each command is the one that the last one named."""
    said, words = [], ["nanobench", "audit", str(recordings)]
    for _ in range(3):
        code, out, err = nanobench(*words[1:], *([] if words[1] in ("new", "report") else ["--jobs", 1]))
        assert code == 0, err
        said.append(words[1])
        words = next_command(out)
    assert said == ["audit", "estimate", "new"]
    assert words[:2] == ["nanobench", "estimate"]


@pytest.mark.slow
def test_a_path_with_a_blank_stays_one_word(nanobench, here, recordings):
    place = here / "my flights"
    place.mkdir()
    for path in sorted(recordings.iterdir()):
        (place / path.name).write_bytes(path.read_bytes())
    assert str(place) in next_command(nanobench("audit", place, "--jobs", 1)[1])


def test_columns_names_a_command_that_finds_its_map(nanobench, here):
    (here / "log.csv").write_text("t,px,py,pz\n" + "".join(f"{0.01 * i},0,0,{1 + 0.001 * i}\n" for i in range(300)))
    code, out, _ = nanobench("columns", "log.csv")
    assert code == 0
    words = next_command(out)
    code, out, _ = nanobench(*words[1:])
    assert code == 0
    words = next_command(out)
    assert words[-2:] == ["--columns", "MAP.toml"]
    assert (here / "MAP.toml").is_file()


def test_nothing_but_the_result_with_json_or_quiet(nanobench, recordings):
    code, out, _ = nanobench("audit", recordings, "--jobs", 1, "--json", "-")
    assert code == 0
    assert json.loads(out)["flights"]
    assert nanobench("audit", recordings, "--jobs", 1, "--quiet")[1] == ""


def test_an_option_that_is_there_gets_the_new_value():
    with click.Context(click.Command("prove")) as context:
        context.meta[WORDS] = ("prove", "--seed", "5", "--cases=9", "--seed=6", "--out", "proof")
        assert again("--seed", 7) == ["nanobench", "prove", "--cases=9", "--out", "proof", "--seed", 7]
        assert again() == ["nanobench", *context.meta[WORDS]]
        context.meta[WORDS] = ("audit", "--verbose", "flights")
        assert again("--verbose") == ["nanobench", "audit", "flights", "--verbose"]

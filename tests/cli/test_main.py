"""The command line itself: exit codes, one line per error, help, imports."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import click
import pytest

from nanobench_tools.cli.help_pages import COMMON
from nanobench_tools.cli.main import FIRST, VERBS, cli
from nanobench_tools.version import __version__

COMMAND = str(Path(sys.executable).with_name("nanobench"))


def run(*arguments, **kwargs):
    return subprocess.run([COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=600, **kwargs)


def test_help_names_every_verb_and_some_examples(nanobench):
    code, out, err = nanobench("--help")
    assert (code, err) == (0, "")
    assert len(out.splitlines()) <= 40
    for verb, (text, example) in VERBS.items():
        assert text in out
        assert example.startswith(f"nanobench {verb}")
        assert (example in out) == (verb in FIRST)
    assert nanobench() == (0, out, "")


@pytest.mark.parametrize("verb", VERBS)
def test_help_of_a_verb_is_one_screen_and_the_whole_page_has_every_option(nanobench, monkeypatch, verb):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, err = nanobench(verb, "--help")
    assert (code, err) == (0, "")
    assert len(out.splitlines()) <= 22
    assert "Example: nanobench" in out
    assert out.startswith(f"Usage: nanobench {verb}")
    assert nanobench(verb, "-h") == (0, out, "")
    code, whole, err = nanobench(verb, "--help", "--verbose")
    assert (code, err) == (0, "")
    assert "Example: nanobench" in whole
    command = cli.get_command(click.Context(cli), verb)
    names = [parameter.opts[0] for parameter in command.params if isinstance(parameter, click.Option)]
    assert {"--help", "--verbose"} & {name for p in command.params for name in p.opts} == {"--help", "--verbose"}
    assert all(re.search(rf"^  .*{name}\b", whole, re.MULTILINE) for name in names)
    if verb in COMMON:
        assert all(f"  {name} " in out or f"  {name}\n" in out for name in COMMON[verb])
        assert out.splitlines()[-1] == f"All {len(names)} options and the details: nanobench {verb} --help --verbose"
    else:
        assert out == whole


def test_version(nanobench):
    assert nanobench("--version")[1].strip() == f"nanobench, version {__version__}"


@pytest.mark.parametrize(("arguments", "says"), [
    (["adit"], "nanobench: no verb 'adit'; did you mean 'audit'?"),
    (["qqqq"], "there are run, audit"),
    (["--bogus"], "nanobench: No such option '--bogus'"),
    (["audit", "--dat", "x"], "nanobench audit: No such option '--dat'"),
    (["audit", "--jobs", "0"], "nanobench audit: Invalid value for '--jobs'"),
    (["audit", "--jobs", "two"], "'two' is not a valid integer"),
    (["audit", "--data"], "nanobench audit: Option '--data' requires an argument"),
    (["audit", "stray"], "nanobench: stray: does not exist"),
    (["sysid", "--train", "{data}", "{empty}", "--test", "{data}"], "{empty} is listed with paths of --train"),
    (["simulate", "stray"], "nanobench simulate: Got unexpected extra argument"),
    (["audit", "--data", "/no/such/place"], "/no/such/place"),
    (["audit", "--data", "{empty}"], "{empty}"),
    (["audit", "--data", "{data}", "--out", "{file}/x"], "{file}/x"),
    (["audit", "--data", "{data}", "--json", "{file}/x.json"], "{file}/x.json"),
    (["audit", "--data", "{data}", "--columns", "/no/such.toml"], "/no/such.toml"),
    (["audit", "--data", "{file}"], "{file}"),
    (["convert", "--data", "{data}", "--to", "word", "--out", "{empty}"], "'word' is not one of"),
    (["convert", "--data", "{data}"], "--out DIR is needed"),
])
def test_bad_usage_and_input_is_one_line_and_exit_code_2(nanobench, recordings, tmp_path, arguments, says):
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("no recording\n")
    places = {"empty": tmp_path / "empty", "file": tmp_path / "file", "data": recordings}
    quiet = ["--quiet", "--jobs", "1"] if "--data" in arguments[:-1] else []
    code, out, err = nanobench(*[a.format(**places) for a in arguments], *quiet)
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert says.format(**places) in err


def test_paths_by_themselves_are_the_same_as_data(nanobench, recordings, tmp_path):
    first, *others = sorted(recordings.glob("*.csv"))
    ways = {"bare": [first, *others], "named": ["--data", recordings], "both": [first, "--data", *others]}
    for name, how in ways.items():
        assert nanobench("audit", *how, "--quiet", "--jobs", 1, "--json", tmp_path / name)[0] == 0
    bare, named, both = (sorted(flight["sha256"] for flight in json.loads((tmp_path / name).read_text())["flights"])
                         for name in ways)
    assert len(bare) == 3
    assert bare == named == both


def test_a_scheduler_nobody_answers_is_one_line(nanobench, recordings):
    code, _, err = nanobench("audit", "--data", recordings, "--scheduler", "tcp://127.0.0.1:9", "--quiet", "--out",
                             recordings / ".." / "nowhere")
    assert code == 2
    assert err.startswith("nanobench: --scheduler tcp://127.0.0.1:9: no Dask scheduler answers there")
    assert err.count("\n") == 1


def test_installed_command_ends_with_the_right_codes(recordings, tmp_path):
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "binary.csv").write_bytes(b"\x00\x01\x02" * 100)
    good = next(recordings.glob("*circle*.csv"))
    some = run("audit", "--data", good, "--data", broken, "--json", tmp_path / "b.json", "--jobs", 1)
    assert some.returncode == 1
    assert "1 SYNTHETIC recording" in some.stderr
    assert json.loads((tmp_path / "b.json").read_text())["failed"][0]["file"].endswith("binary.csv")
    assert sum("binary.csv" in line and line.startswith("failed: ") for line in some.stderr.splitlines()) == 1
    bad = run("audit", "--data", broken, "--quiet")
    assert bad.returncode == 2
    assert bad.stderr.count("\n") == 1
    assert run("nonsense").returncode == 2


@pytest.mark.slow
def test_interrupt_is_130_and_says_how_to_go_on(recordings, empty_cache, tmp_path):
    env = {**os.environ, "NANOBENCH_CACHE": str(empty_cache), "PYTHONPATH": str(tmp_path)}
    (tmp_path / "sitecustomize.py").write_text(
        "import pathlib, time\nimport nanobench_tools.harness.audits as a\n"
        f"def slow(flight):\n    pathlib.Path({str(tmp_path / 'begun')!r}).touch()\n    time.sleep(600)\n"
        "a.audit_item = slow\n")
    command = [COMMAND, "audit", "--data", str(recordings), "--jobs", "1", "--out", str(tmp_path / "o")]
    process = subprocess.Popen(command, env=env, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120
    while not (tmp_path / "begun").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 130
    assert err.splitlines()[1:] == ["nanobench: interrupted; run the same command again to resume"]


@pytest.mark.slow
def test_a_closed_pipe_is_quiet_and_the_work_goes_on(recordings, tmp_path):
    audit = f"{COMMAND} audit --data {recordings} --jobs 1 --verbose --json {tmp_path}/a.json"
    done = subprocess.run(["/bin/bash", "-c", f"set -o pipefail; {audit} | head -1"], capture_output=True, text=True,
                          timeout=600)
    assert done.stderr.count("\n") == 1
    assert done.returncode == 0
    assert len(json.loads((tmp_path / "a.json").read_text())["flights"]) == 3
    printed = subprocess.run(["/bin/bash", "-c", f"set -o pipefail; {COMMAND} --help | true"], capture_output=True,
                             text=True)
    assert (printed.returncode, printed.stderr) == (0, "")


def test_a_bug_is_one_line_unless_asked(nanobench, recordings, monkeypatch):
    import nanobench_tools.sources.discover as discover

    monkeypatch.setattr(discover, "load_recordings", lambda *a, **k: 1 / 0)
    code, _, err = nanobench("audit", "--data", recordings)
    assert code == 2
    assert err.count("\n") == 1
    assert "ZeroDivisionError: division by zero" in err
    assert "NANOBENCH_DEBUG=1" in err
    monkeypatch.setenv("NANOBENCH_DEBUG", "1")
    assert "Traceback" in nanobench("audit", "--data", recordings)[2]


def seconds(code: str) -> float:
    """Best of three, processor time of a fresh process in s."""
    best = float("inf")
    for _ in range(3):
        before = os.times()
        subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
        after = os.times()
        best = min(best, after.children_user + after.children_system - before.children_user - before.children_system)
    return best


def test_import_budget():
    assert seconds("import nanobench_tools") < 0.6
    assert seconds("from nanobench_tools.cli.main import main; main(['--help'])") < 0.5


PACKAGES = ("nanobench_tools", "nanobench_tools.harness", "nanobench_tools.cli.main", "estimators", "controllers",
            "identification")
HEAVY = ("plotly", "dask", "distributed", "matplotlib", "cflib", "pandas", "evo")


def test_heavy_and_foreign_packages_are_not_imported_beforehand():
    """By none of the modules: one after the other in one process, with what each of them brought."""
    modules = (*PACKAGES, *(f"nanobench_tools.cli.{verb}" for verb in VERBS))
    code = (f"import importlib, json, sys\nbrought = {{}}\nfor module in {modules}:\n"
            f"    importlib.import_module(module)\n    brought[module] = [m for m in {HEAVY} if m in sys.modules]\n"
            "print(json.dumps(brought))")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stderr == ""
    assert json.loads(done.stdout) == {module: [] for module in modules}

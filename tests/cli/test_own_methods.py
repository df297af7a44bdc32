"""Methods from outside the package: the examples of docs/own_methods.md, by ``module:Class`` and by entry point."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from nanobench_tools import Controller, Estimator, Predictor
from nanobench_tools.cli.new import STARTERS
from nanobench_tools.sources.discover import load_recordings

COMMAND = str(Path(sys.executable).with_name("nanobench"))
METHODS = {"estimators": ("own_estimator", "GyroAndLine"), "predictors": ("own_predictor", "StraightOn"),
           "controllers": ("own_controller", "TiltAndTurn")}


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A distribution with the three examples and their entry points, installed by pip into a folder of its own."""
    project, target = tmp_path_factory.mktemp("project"), tmp_path_factory.mktemp("target")
    lines = ["[metadata]", "name = nanobench-own-methods", "version = 1.0", "[options]", "py_modules ="]
    lines += [f"    {module}" for module, _ in METHODS.values()] + ["[options.entry_points]"]
    for group, (module, name) in METHODS.items():
        (project / f"{module}.py").write_text((STARTERS / f"{module}.py.txt").read_text())
        lines += [f"nanobench.{group} =", f"    {module} = {module}:{name}"]
    (project / "setup.cfg").write_text("\n".join(lines) + "\n")
    (project / "pyproject.toml").write_text('[build-system]\nrequires = ["setuptools"]\n'
                                            'build-backend = "setuptools.build_meta"\n')
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps", "--no-index"]
    subprocess.run([*pip, "--no-build-isolation", "--target", str(target), str(project)], check=True, timeout=120)
    return target


def launched(*arguments, path: Path, cwd: Path):
    env = {**os.environ, "PYTHONPATH": str(path)}
    command = [COMMAND, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, env=env, cwd=cwd)


@pytest.fixture
def way(request, tmp_path):
    """(group) -> the name for --method, the PYTHONPATH for it, and the working directory. ``make test`` takes each way
    with one kind of method."""
    def give(group):
        module, name = METHODS[group]
        if request.param == "entry point":
            return module, request.getfixturevalue("installed"), tmp_path
        (tmp_path / f"{module}.py").write_text((STARTERS / f"{module}.py.txt").read_text())
        return f"{module}:{name}", tmp_path / "nothing", tmp_path

    return give


@pytest.mark.parametrize("way", ["module:Class", pytest.param("entry point", marks=pytest.mark.slow)], indirect=True)
def test_an_own_estimator_is_scored(way, recordings, tmp_path):
    name, path, cwd = way("estimators")
    done = launched("estimate", "--protocol", "clean", "--only", "--method", name, "--data", recordings, "--json",
                    "e.json",
                     "--jobs", 1, path=path, cwd=cwd)
    assert done.returncode == 0, done.stderr
    rows = json.loads((cwd / "e.json").read_text())["rows"]
    assert {row["method"] for row in rows} == {"gyro_and_line"}
    assert next(row for row in rows if row["group"] == "all")["n"] == 3


@pytest.mark.parametrize("way", [pytest.param("module:Class", marks=pytest.mark.slow), "entry point"], indirect=True)
@pytest.mark.slow
def test_an_own_predictor_is_scored(way, recordings, tmp_path):
    name, path, cwd = way("predictors")
    done = launched("sysid", "--method", name, "--fit", "none", "--data", recordings, "--json", "s.json", "--jobs", 1,
                     path=path, cwd=cwd)
    assert done.returncode == 0, done.stderr
    rows = json.loads((cwd / "s.json").read_text())["rows"]
    assert "straight_on" in {row["model"] for row in rows}


@pytest.mark.slow
@pytest.mark.parametrize("way", ["entry point"], indirect=True)  # module:Class flies in practice/test_simulate_cli.py
def test_an_own_controller_flies(way):
    name, path, cwd = way("controllers")
    done = launched("simulate", "--controller", name, "--flights", 1, "--trajectory", "circle", "--speed", "slow",
                     "--seconds", 5, "--out", "flown", path=path, cwd=cwd)
    assert done.returncode == 0, done.stderr
    flight = load_recordings([cwd / "flown"]).flights[0]
    assert flight.provenance.synthetic
    mocap, setpoint = flight["mocap"], flight["setpoint"]
    streamed = (mocap.time_s > 8.0) & (mocap.time_s < 11.0)
    error = mocap["px", "py", "pz"] - setpoint.interpolate(("x", "y", "z"), mocap.time_s)
    assert np.linalg.norm(error, axis=1)[streamed].max() < 0.8
    assert mocap["pz"][streamed].min() > 0.7


def test_the_examples_are_short_and_are_what_they_claim(monkeypatch, tmp_path):
    for path in STARTERS.glob("own_*.txt"):
        (tmp_path / path.stem).write_text(path.read_text())
    monkeypatch.syspath_prepend(tmp_path)
    for (module, name), kind in zip(METHODS.values(), (Estimator, Predictor, Controller), strict=True):
        assert isinstance(getattr(__import__(module), name)(), kind)
        lines = [line for line in (STARTERS / f"{module}.py.txt").read_text().splitlines() if line.strip()]
        assert len(lines) <= 36


@pytest.mark.slow
def test_a_changed_own_method_is_not_answered_from_the_store(recordings, tmp_path):
    text = (STARTERS / "own_estimator.py.txt").read_text()
    call = ["estimate", "--protocol", "clean", "--only", "--method", "own_estimator:GyroAndLine",
            "--data", recordings, "--json",
            "e.json", "--out", "o", "--jobs", 1]
    found = []
    for source in (text, text, text.replace("velocity[last] * age", "0.5 * velocity[last] * age")):
        (tmp_path / "own_estimator.py").write_text(source)
        done = launched(*call, path=tmp_path / "nothing", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        found.append(json.loads((tmp_path / "e.json").read_text())["rows"])
    assert found[0] == found[1]
    assert found[0] != found[2]


@pytest.mark.parametrize(("source", "says"), [
    ("class Bad:\n    name = 'bad'\n    causal = True\n    def estimate(self, flight):\n        return 1 / 0\n",
     "ZeroDivisionError"),
    ("class Bad:\n    pass\n", "own_bad:Bad"), ("1 / 0\n", "own_bad:Bad"), ("", "own_bad:Bad")])
def test_a_broken_own_method_is_reported_in_one_line(nanobench, recordings, tmp_path, monkeypatch, source, says):
    (tmp_path / "own_bad.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    sys.modules.pop("own_bad", None)
    code, _, err = nanobench("estimate", "--protocol", "clean", "--only", "--method", "own_bad:Bad",
                             "--data", recordings,
                             "--quiet", "--json", tmp_path / "e.json", "--jobs", 1)
    assert "Traceback" not in err
    assert says in err
    if "estimate" in source:
        assert code == 1
        assert len(json.loads((tmp_path / "e.json").read_text())["failed"]) == 3
    else:
        assert code == 2
        assert err.count("\n") == 1

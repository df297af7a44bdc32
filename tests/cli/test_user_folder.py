"""A user's own ``controllers`` and ``estimators`` beside ours: theirs are flown and scored, ours keep working."""

import json
import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from nanobench_tools import UsageError
from nanobench_tools.harness.identity import method_identity
from nanobench_tools.lookup import registry, user_folder

ROOT = Path(__file__).parents[2]
SHOW = ("import sys; from nanobench_tools.lookup.registry import load; "
        "found = load('controllers', sys.argv[1]); print(found().mark())")


@pytest.fixture
def folder(tmp_path):
    """Packages of a user: names that are ours (the package, and ``gains`` and ``delay`` in it), every way of import."""
    texts = {
        "controllers/__init__.py": "MARK = 'theirs'\n",
        "controllers/gains.py": "K = 3.0\ndef late():\n    from . import delay\n    from controllers.delay import D\n"
                                "    return D, delay.D\n",
        "controllers/delay.py": "D = 0.25\n",
        "controllers/deep/__init__.py": "",
        "controllers/deep/inner.py": "from ..gains import K\nimport controllers.delay as other\nD = other.D\n",
        "controllers/pid.py": ("import json\nimport math, helper, controllers.delay\nfrom controllers import MARK\n"
                               "from controllers.gains import K, late\nfrom .deep.inner import D\n"
                               "from nanobench_tools import so3\n"
                               "class Pid:\n    name = 'pid'\n    information = 'state'\n    period_s = 0.01\n"
                               "    def reset(self, n):\n        pass\n"
                               "    def command(self, time_s, state, reference):\n        return None\n"
                               "    def mark(self):\n        import controllers.gains\n"
                               "        return [MARK, K, D, *late(), controllers.gains.K, controllers.delay.D, "
                               "helper.seen(), so3.__name__]\n"),
        "helper.py": "from controllers import MARK\ndef seen():\n    from controllers.gains import K\n"
                     "    return MARK * int(K)\n",
        "estimators/still.py": (
            "import numpy as np\nfrom nanobench_tools import Estimate\nfrom .tools import zeros\n"
            "class Still:\n    name = 'still'\n    causal = True\n    def estimate(self, flight):\n"
            "        from estimators.tools import zeros as again\n        assert zeros is again\n"
            "        t = flight['imu'].time_s\n"
            "        return Estimate(t, zeros(len(t), 3), np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1)))\n"),
        "estimators/tools.py": "import numpy as np\ndef zeros(n, k):\n    return np.zeros((n, k))\n",
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


EXPECTED = ["theirs", 3.0, 0.25, 0.25, 0.25, 3.0, 0.25, "theirstheirstheirs", "nanobench_tools.so3"]


def run(*words, cwd, path=(ROOT,)):
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, path))}
    return subprocess.run([sys.executable, *map(str, words)], capture_output=True, text=True, timeout=1800, env=env,
                          cwd=cwd)


def nanobench(*words, cwd, path=(ROOT,), module=True):
    """As ``python -m`` (the folder stands first on the path) or as the command (it is not on it)."""
    start = ["-m", "nanobench_tools.cli.main"] if module else [
        "-P", "-c", "import sys; from nanobench_tools.cli.main import main; sys.exit(main())"]
    return run(*start, *words, cwd=cwd, path=path)


@pytest.mark.parametrize("name", ["controllers.pid:Pid", "fly_mine:Mine"])
@pytest.mark.slow
def test_a_users_controllers_are_loaded_with_all_they_import(folder, name):
    (folder / "fly_mine.py").write_text("from controllers.pid import Pid\nclass Mine(Pid):\n    pass\n")
    for options in (["-P", "-c"], ["-c"]):  # without and with the folder first on the path
        done = run(*options, SHOW, name, cwd=folder)
        assert done.returncode == 0, done.stderr
        assert done.stdout.strip() == str(EXPECTED)


def test_ours_that_are_loaded_already_stay_and_theirs_come_beside(folder, monkeypatch):
    import controllers.gains as ours

    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", [*sys.path])
    theirs = registry.load("controllers", "controllers.pid:Pid")
    assert theirs().mark() == EXPECTED
    assert sys.modules["controllers.gains"] is ours
    assert registry.load("controllers", "geometric").__module__ == "controllers.geometric"
    assert user_folder.own_name(theirs.__module__) == (folder, "controllers.pid")
    assert pickle.loads(pickle.dumps(theirs)) is theirs
    with pytest.raises(UsageError, match="lqr"):  # a name of ours that their package has not: never ours by chance
        registry.load("controllers", "controllers.lqr:Lqr")


def test_two_folders_are_not_mixed_up(folder, monkeypatch, tmp_path_factory):
    other = tmp_path_factory.mktemp("other")
    (other / "controllers").mkdir()
    (other / "controllers" / "pid.py").write_text("class Pid:\n    def mark(self):\n        return 'other'\n")
    found = []
    for place in (folder, other):
        monkeypatch.setattr(sys, "path", [p for p in sys.path if p not in (str(folder), str(other))])
        monkeypatch.chdir(place)
        found.append(registry.load("controllers", "controllers.pid:Pid")().mark())
    assert found == [EXPECTED, "other"]


@pytest.mark.slow
def test_what_a_users_method_imports_counts_for_its_identity(folder, monkeypatch):
    script = ("from nanobench_tools.lookup.registry import load; "
              "from nanobench_tools.harness.identity import method_identity; "
              "print(method_identity(load('controllers', 'controllers.pid:Pid')))")
    before, same = (run("-c", script, cwd=folder).stdout for _ in range(2))
    (folder / "controllers" / "deep" / "inner.py").write_text("D = 0.5\n")
    changed = run("-c", script, cwd=folder).stdout
    (folder / "helper.py").write_text("def seen():\n    return 'changed'\n")
    again = run("-c", script, cwd=folder).stdout
    assert before == same
    assert before.startswith("controllers.pid:Pid ")
    assert len({before, changed, again}) == 3
    assert "controllers.geometric:Geometric" in method_identity(registry.load("controllers", "geometric"))


@pytest.mark.parametrize("jobs", [pytest.param(1, marks=pytest.mark.slow), 2])
@pytest.mark.slow
def test_a_users_estimator_is_scored_beside_ours_also_in_other_processes(folder, recordings, jobs):
    one = min(recordings.glob("*.csv"))
    done = nanobench("estimate", "--protocol", "clean", "--only", "--method", "estimators.still:Still", "--method",
                     "constant_velocity", "--data", one, "--json", "e.json", "--jobs", jobs, cwd=folder)
    assert done.returncode == 0, done.stderr
    body = json.loads((folder / "e.json").read_text())
    assert not body["failed"]
    assert {row["method"] for row in body["rows"]} == {"still", "constant_velocity"}


def test_ours_are_loaded_in_a_folder_with_controllers_of_its_own(folder):
    done = run("-P", "-c", "from nanobench_tools.lookup.registry import load; print(load('controllers', 'geometric'))",
               cwd=folder)
    assert (done.returncode, done.stdout.strip()) == (0, "<class 'controllers.geometric.Geometric'>"), done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(("module", "on_path"), [(False, False), (True, True)])
def test_ours_fly_from_a_folder_with_controllers_of_its_own(folder, module, on_path):
    path = (folder, ROOT) if on_path else (ROOT,)
    done = nanobench("simulate", "--controller", "geometric", "--flights", 1, "--trajectory", "circle", "--speed",
                     "slow", "--seconds", 3, "--out", "flown", cwd=folder, path=path, module=module)
    assert done.returncode == 0, done.stderr
    assert list((folder / "flown").iterdir())


def test_a_script_with_controllers_of_its_own_is_told_in_one_line(folder):
    script = ("import controllers.gains\nfrom nanobench_tools import UsageError\n"
              "from nanobench_tools.lookup import registry\n"
              "assert controllers.gains.K == 3.0\n"
              "try:\n    registry.load('controllers', 'geometric')\nexcept UsageError as error:\n    print(error)\n")
    done = run("-c", script, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("\n") == 1
    assert str(folder / "controllers" / "__init__.py") in done.stdout


@pytest.mark.slow
def test_a_folder_that_only_has_the_name_is_no_package(tmp_path):
    (tmp_path / "controllers").mkdir()
    (tmp_path / "controllers" / "notes.txt").write_text("none")
    script = ("from nanobench_tools.lookup.registry import load; "
              "print(load('controllers', 'controllers.geometric:Geometric').__module__)")
    done = run("-c", script, cwd=tmp_path)
    assert (done.returncode, done.stdout.strip()) == (0, "controllers.geometric"), done.stderr

"""``nanobench run``: everything in one folder, the same again after a kill, labelled by what it was made from."""

import io
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from unittest import mock

import pytest

from identification.greybox import ablation_study
from nanobench_tools.cli import run as run_module
from nanobench_tools.cli import run_clocks
from nanobench_tools.cli.main import main
from nanobench_tools.errors import InputError
from nanobench_tools.harness.store import Store
from nanobench_tools.physics.simulator import read_simulator
from nanobench_tools.practice import flights as practice
from nanobench_tools.steps.options import Options

COMMAND = [sys.executable, "-c", "import sys; from identification.greybox import ablation_study as a; "
           "a.SHORT = a.SHORT[:1]; "
           "from nanobench_tools.cli.main import main; sys.exit(main())"]
"""The main job with the quickest of its fits only, in a process of its own."""

ODD = (b"a\xff[red]x[", b"b[bold]\nof two lines", b"c")
"""Names of recordings."""

FILES = ("audit.json", "estimate.json", "control.json", "sysid.json", "report.html")


def bodies(folder: Path) -> dict:
    """Everything in the result files that may not depend on when and where it was made."""
    found = {name: json.loads((folder / name).read_text()) for name in FILES if name.endswith(".json")}
    for body in found.values():
        body.pop("manifest")
        for on_clock in (body, *body.get("by_clock", {}).values()):
            if on_clock.get("simulator"):
                on_clock["simulator"] = Path(on_clock["simulator"]).name
    return found


@pytest.fixture(scope="session")
def whole_job(recordings, tmp_path_factory, made_once):
    """The main job, once in a run, on recordings with odd names and a copy: (exit code, stdout, stderr, folder,
    file of --json)."""
    def make():
        place = tmp_path_factory.mktemp("whole_job")
        data, out, whole, said = place / "data", place / "out", place / "all.json", (io.StringIO(), io.StringIO())
        data.mkdir()
        for name, path in zip(ODD, sorted(recordings.glob("*.csv")), strict=True):
            for end, source in ((b".csv", path), (b"_metadata.yaml", path.with_name(f"{path.stem}_metadata.yaml"))):
                Path(os.fsdecode(os.fsencode(data) + b"/" + name + end)).write_bytes(source.read_bytes())
        first = Path(os.fsdecode(os.fsencode(data) + b"/" + ODD[0] + b".csv"))
        (data / "copy[blue].csv").write_bytes(first.read_bytes())
        with redirect_stdout(said[0]), redirect_stderr(said[1]), mock.patch.object(ablation_study, "SHORT",
                                                                                   ablation_study.SHORT[:1]):
            code = main(["run", "--data", str(data), "--out", str(out), "--json", str(whole), "--jobs", "1"])
        return code, said[0].getvalue(), said[1].getvalue(), str(out), str(whole)

    code, out, err, folder, whole = made_once("whole_job", make)
    return code, out, err, Path(folder), Path(whole)


@pytest.mark.slow
def test_the_main_job_leaves_all_results_labelled_synthetic(whole_job):
    code, out, err, place, _ = whole_job
    assert code == 0, err
    assert all((place / name).stat().st_size > 1000 for name in FILES)
    page = (place / "report.html").read_text()
    assert all(f"Task {task}" in page for task in (1, 2, 3))
    assert "SYNTHETIC" in page
    tables = [*place.glob("*.csv"), *place.glob("*.tex")]
    assert len(tables) >= 8
    assert all("SYNTHETIC" in table.read_text() for table in tables)
    assert {name for name, body in bodies(place).items() if not body["synthetic"]} == set()
    assert [entry for body in bodies(place).values() for entry in body["failed"]] == []
    assert all(body["rows"] for name, body in bodies(place).items() if name != "audit.json")
    rows = bodies(place)["estimate.json"]["rows"]
    assert {r["clock"] for r in rows if r["protocol"] == "as-published"} == {"as-recorded"}
    assert {r["clock"] for r in rows if r["protocol"] == "clean"} == {"as-recorded", "offset", "retimed"}
    assert {r["clock"] for r in rows if r["protocol"] == "blackout"} == {"as-recorded", "offset", "retimed", "joint"}
    titles = [line for line in out.splitlines() if line.startswith(("Task", "SYNTHETIC"))]
    assert [line for line in titles if "SYNTHETIC" not in line] == []
    assert "4 SYNTHETIC recordings" in err
    assert "Task 1, before and after re-timing" in page
    sysid = json.loads((place / "sysid.json").read_text())
    assert {r["clock"] for r in sysid["rows"]} == {"as-recorded", "retimed"}
    assert len({(r["model"], r["truth"], r["group"], r["clock"], r["start"])
                for r in sysid["rows"]}) == len(sysid["rows"])
    assert (sysid["clock"], list(sysid["by_clock"])) == ("as-recorded", ["retimed"])
    files = []
    for found in (sysid, sysid["by_clock"]["retimed"]):  # what is said stands in the file that is named
        model, said = read_simulator(found["simulator"]), found["parameters"][found["best"]]
        assert model.values[model.names.index("thrust_voltage.c[0]")] == pytest.approx(
            said["thrust_voltage.c[0]"]["value"], rel=1e-6)
        files.append(Path(found["simulator"]))
    assert [file.name for file in files] == ["simulator.toml", "simulator_retimed.toml"]
    assert files[0].read_text() != files[1].read_text()


@pytest.mark.slow
def test_json_holds_all_results_and_odd_names_of_files_do_no_harm(whole_job):
    code, out, err, place, path = whole_job
    assert code == 0, err
    assert any(line.startswith("copy[blue]") for line in out.splitlines())
    whole = json.loads(path.read_text())
    assert whole["audit"]["copies"] == [["a\\udcff[red]x[", "copy[blue]"]]
    assert (whole["schema"], whole["synthetic"], whole["failed"]) == ("nanobench-run/1", True, [])
    for name in ("audit", "estimate", "control", "sysid"):
        assert whole[name] == json.loads((place / f"{name}.json").read_text())


@pytest.mark.slow
def test_killed_in_the_middle_it_goes_on_and_ends_the_same(whole_job, tmp_path):
    """As when it is not killed, in one process and not in several."""
    whole = whole_job[3]
    command = [*COMMAND, "run", "--data", str(whole.parent / "data"), "--out", str(tmp_path / "killed"), "--jobs", "2",
               "--quiet"]
    apart = {**os.environ, "NANOBENCH_CACHE": str(tmp_path / "cache")}  # nothing of the run above is known there
    process = subprocess.Popen(command, start_new_session=True, env=apart)
    store = tmp_path / "cache" / "items"
    deadline = time.monotonic() + 900
    while len(list(store.glob("*.json"))) < 8 and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    finished = {path.stem: path.stat().st_ino for path in store.glob("*.json")}
    assert len(finished) >= 8
    assert all(Store(store).get(key) is not None for key in finished)
    for path in (tmp_path / "killed").glob("*.json"):
        json.loads(path.read_text())
    again = subprocess.run(command, capture_output=True, text=True, timeout=900, env=apart)
    assert (again.returncode, again.stdout, again.stderr) == (0, "", "")
    after = {path.stem: path.stat().st_ino for path in store.glob("*.json")}
    assert {key: after[key] for key in finished} == finished
    assert bodies(tmp_path / "killed") == bodies(whole)


@pytest.mark.slow
def test_without_recordings_it_simulates_practice_flights_once(nanobench, crowd, tmp_path, monkeypatch):
    """What flies and what the tasks make of recordings is of other tests: here each notes what it is given."""
    given = []
    for task in ("estimate_on", "control_on", "sysid_on"):
        monkeypatch.setattr(run_clocks, task, lambda recordings: given.append(recordings) or {"rows": []})
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("NANOBENCH_DATA", raising=False)
    monkeypatch.setattr(run_module, "PRACTICE_SEEDS", 1)
    monkeypatch.setattr(run_module, "PRACTICE_FLIGHTS", 1)
    monkeypatch.setattr(practice, "practice_flights", lambda n, seed, **_: [crowd.flight("short trefoil")] * n)
    code, _, err = nanobench("run", "--jobs", 1)
    assert code == 0, err
    assert "practice flights, SYNTHETIC" in err
    assert "1 SYNTHETIC recording from results/practice" in err
    assert len(given) == 3
    assert all(len(one.flights) == len(one.audits) == 1 and one.flights[0].provenance.synthetic for one in given)
    assert (tmp_path / "results" / "report.html").exists()
    made = {path: path.stat().st_mtime_ns for path in (tmp_path / "results" / "practice" / "seed_0").iterdir()}
    again, folder = Options(out=Path("results"), jobs=1, quiet=True), Path("results", "practice")
    assert run_module.simulate(again, folder) == folder
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "results" / "practice" / "seed_0").iterdir()} == made
    next(iter(made)).write_text("")
    run_module.simulate(again, folder)
    assert again.failed == []
    assert next(iter(made)).stat().st_size > 100


def test_a_task_without_enough_recordings_is_listed_and_the_others_go_on(nanobench, recordings, tmp_path, monkeypatch):
    """Task 3, which has enough and takes long, is left out."""
    monkeypatch.setattr(run_clocks, "estimate_on", lambda recordings: {"rows": []})
    code, out, err = nanobench("run", "--data", next(recordings.glob("*circle*.csv")), "--out", tmp_path, "--jobs", 1)
    assert code == 0, err
    assert [line for line in out.splitlines() if line.startswith("Task 1 (sysid) is not possible: no flight")]
    assert "failed" not in err
    assert bodies(tmp_path)["sysid.json"]["failed"][0]["item"] == "sysid"
    assert bodies(tmp_path)["control.json"]["failed"] == []
    assert (tmp_path / "report.html").exists()


def test_recordings_that_suffice_for_no_task_fail(nanobench, recordings, tmp_path, monkeypatch):
    def lacking(recordings):
        raise InputError("here", "no such stream", "record it")

    for task in ("estimate_on", "control_on", "sysid_on"):
        monkeypatch.setattr(run_clocks, task, lacking)
    code, out, err = nanobench("run", "--data", next(recordings.glob("*circle*.csv")), "--out", tmp_path, "--jobs", 1)
    assert code == 1
    assert "Task 2 (control) is not possible: no such stream; record it" in out
    assert err.count("failed: ") == 3


@pytest.mark.real
@pytest.mark.slow
def test_real_recordings_are_never_called_synthetic(nanobench, one_fit, real_data, tmp_path):
    datasets = real_data / "nanobench" / "datasets"
    places = sorted(datasets.rglob("*trefoil_slow_rep1[._]*")) + sorted(datasets.rglob("*circle_medium_rep*"))
    data = [word for place in places if place.is_file() for word in ("--data", place)]
    code, out, err = nanobench("run", *data, "--out", tmp_path, "--jobs", 1)
    assert code == 0, err
    assert "SYNTHETIC" not in out + err
    assert not any("SYNTHETIC" in path.read_text(errors="replace") for path in tmp_path.iterdir() if path.is_file())
    assert not any(body["synthetic"] for body in bodies(tmp_path).values())

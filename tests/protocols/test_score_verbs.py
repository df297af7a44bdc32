"""The verbs estimate, control and sysid on practice recordings: files, exit codes, errors in one line."""

import json
import shutil
from types import SimpleNamespace

import numpy as np
import pytest

from nanobench_tools.cli.main import main
from nanobench_tools.protocols import task2
from nanobench_tools.protocols.sessions import Drawn
from nanobench_tools.sources.discover import load_recordings
from nanobench_tools.sources.nanobench_writer import write_nanobench
from nanobench_tools.steps.controlling import _show
from nanobench_tools.steps.estimating import ranked_by_clock
from nanobench_tools.steps.options import Options


@pytest.fixture(scope="module")
def folder(tmp_path_factory, crowd):
    """Three short practice recordings (SYNTHETIC)."""
    place = tmp_path_factory.mktemp("practice")
    for flight in map(crowd.flight, ("circle", "trefoil", "helix")):
        write_nanobench(flight, place / f"{flight.name}.csv")
    return place


@pytest.fixture
def call(capsys, tmp_path):
    """(exit code, result file or None, stdout, stderr) of a command line."""
    def run(*arguments):
        path = tmp_path / "result.json"
        path.unlink(missing_ok=True)
        code = main([*map(str, arguments), "--json", str(path), "--jobs", "1"])
        out = capsys.readouterr()
        return code, json.loads(path.read_text()) if path.exists() else None, out.out, out.err

    return run


def test_estimate(call, folder, tmp_path):
    code, result, out, err = call("estimate", "--data", folder, "--protocol", "clean", "--out", tmp_path / "o")
    assert code == 0, err
    assert (result["schema"], result["synthetic"], result["failed"]) == ("nanobench-estimate/1", True, [])
    assert "SYNTHETIC" in out
    rows = {(row["method"], row["group"]): row for row in result["rows"]}
    row = rows["onboard_ekf", "all"]
    assert (row["protocol"], row["causal"], row["n"], len(row["flights"])) == ("clean", True, 3, 3)
    found = row["metrics"]["ate_rmse_m"]
    assert set(found) == {"mean", "std", "median", "p90", "ci95", "n", "sessions", "design_effect", "intra_class",
                          "ci_why"}
    assert (found["ci95"], found["sessions"], row["sessions"]) == (None, 1, 1)  # one vehicle's flights of one day
    assert found["ci_why"] == row["ci_why"]
    assert row["ci_why"].startswith("one session")
    assert row["metrics"]["ate_rmse_m"]["mean"] < 0.1 < rows["hold_position", "all"]["metrics"]["ate_rmse_m"]["mean"]
    assert rows["onboard_ekf", "circle"]["metrics"]["ate_rmse_m"]["ci95"] is None
    assert {"slow/circle", "trefoil", "helix"} <= {group for _, group in rows}


@pytest.mark.slow
def test_written_trajectories_give_the_same_scores(call, folder, tmp_path):
    _, first, _, _ = call("estimate", "--data", folder, "--protocol", "clean", "--out", tmp_path / "o")
    made = tmp_path / "o" / "trajectories"
    assert {p.name for p in made.iterdir()} == {"onboard_ekf", "hold_position", "constant_velocity", "truth"}
    for path in (made / "onboard_ekf").iterdir():
        scored, truth = np.loadtxt(path), np.loadtxt(made / "truth" / path.name)
        assert np.array_equal(scored[:, 0], truth[:, 0])
        assert scored[0, 0] > 1e9
    code, again, _, err = call("estimate", "--data", folder, "--trajectory-dir", made / "onboard_ekf")
    assert code == 0, err
    a, b = (next(r for r in result["rows"] if (r["method"], r["group"]) == ("onboard_ekf", "all"))["metrics"]
            for result in (first, again))
    for name in ("ate_rmse_m", "rte_1m_m", "attitude_geodesic_rmse_deg", "rte_1m_start_frame_m"):
        assert b[name]["mean"] == pytest.approx(a[name]["mean"], rel=1e-5), name
    assert b["velocity_rmse_m_s"]["mean"] is None
    # A second run is answered from the store; deleted trajectories come back all the same.
    shutil.rmtree(made)
    _, third, _, _ = call("estimate", "--data", folder, "--protocol", "clean", "--out", tmp_path / "o")
    assert third["rows"] == first["rows"]
    assert len(list((made / "onboard_ekf").iterdir())) == 3


def test_truth_scored_as_a_trajectory_has_no_error(call, folder, tmp_path):
    call("estimate", "--data", folder, "--protocol", "clean", "--out", tmp_path / "o", "--only", "--method",
         "onboard_ekf")
    shutil.move(tmp_path / "o" / "trajectories" / "truth", tmp_path / "mine")
    next(iter((tmp_path / "mine").iterdir())).unlink()
    code, result, _, _ = call("estimate", "--data", folder, "--trajectory-dir", tmp_path / "mine")
    row = next(r for r in result["rows"] if r["group"] == "all")
    assert (code, row["method"], row["causal"], row["n"]) == (0, "mine", None, 2)
    assert row["metrics"]["ate_unaligned_rmse_m"]["mean"] < 1e-6
    assert "not known" in row["given"]


def test_trajectory_files_alone_are_not_scored_on_another_clock():
    """Two folders of a flight whose clock wanders."""
    rows = [SimpleNamespace(protocol="clean", inputs="files", group="all", clock="as-recorded", flights=["f"],
                            method=name, metrics={}) for name in ("one", "two")]
    audits = {"f": SimpleNamespace(faults=[SimpleNamespace(kind="clock_wander")])}
    assert ranked_by_clock(Options(), [], audits, SimpleNamespace(rows=rows), methods=[]) == []


def test_broken_trajectories_fail_alone_and_are_named(call, folder, tmp_path):
    call("estimate", "--data", folder, "--protocol", "clean", "--out", tmp_path / "o", "--only", "--method",
         "onboard_ekf")
    made = tmp_path / "o" / "trajectories" / "onboard_ekf"
    broken = sorted(made.iterdir())[0]
    broken.write_text(broken.read_text().replace(".", ",", 5))
    code, result, _, _ = call("estimate", "--data", folder, "--trajectory-dir", made)
    assert code == 1
    assert len(result["failed"]) == 1
    assert broken.name in result["failed"][0]["error"]
    assert next(r for r in result["rows"] if r["group"] == "all")["n"] == 2
    assert result["left_out"] == [{"flight": broken.stem, "reason": "every method failed on it"}]


def test_control(call, folder):
    code, result, out, err = call("control", "--data", folder)
    assert code == 0, err
    assert {row["controller"] for row in result["gate"]} == {"pid"}
    assert len(result["gate"]) == 3
    assert "plant: the recorded vehicle as shipped" in result["gate_note"]
    assert "SYNTHETIC" in out
    assert {row["plant"] for row in result["rows"]} == {"real"}
    assert {row["reference"] for row in result["rows"]} == {"circle", "trefoil", "helix"}
    for row in result["rows"]:
        assert 0.0 < row["metrics"]["rmse_m"] < 2.0
        assert row["statistics"]["rmse_m"]["n"] == row["n"]
    code, result, _, _ = call("control", "--data", folder, "--controller", "onboard_pid", "--protocol", "clean",
                              "--plant", "real")
    assert {row["controller"] for row in result["rows"]} == {"pid"}


@pytest.mark.slow
def test_control_says_why_a_recording_is_left_out(call, crowd, folder, tmp_path, monkeypatch):
    flight = crowd.flight("mellinger oval")
    write_nanobench(flight, tmp_path / "mellinger" / f"{flight.name}.csv")
    places = ("--data", folder, "--data", tmp_path / "mellinger")
    _, result, _, _ = call("control", *places, "--controller", "onboard_mellinger", "--plant", "real")
    assert {row["controller"] for row in result["rows"]} == {"mellinger"}
    assert [x["reason"] for x in result["left_out"]] == ["flown by pid, not requested"] * 3
    monkeypatch.setattr(task2, "score", fails)
    code, result, _, err = call("control", *places, "--controller", "onboard_mellinger", "--plant", "real")
    assert (code, result["rows"]) == (1, [])
    assert sorted(x["reason"] for x in result["left_out"]) == [
        "every method failed on it", *["flown by pid, not requested"] * 3]
    assert "this one fails" in err


def fails(case):
    raise ValueError("this one fails")


def test_names_of_dropped_flights_are_text(capsys):
    row = task2.TrackingRow("real", "as-published", "pid", "as-published", None, None, "as flown", 1, [],
                            ["a[bold]b", "c\nd[/red]"], Drawn(1, {}), {}, {})
    _show(Options(verbose=True), [row])
    assert "as was published: a[bold]b, c d[/red]\n" in capsys.readouterr().out


def test_sysid(call, folder, tmp_path):
    for place, files in (("train", sorted(folder.glob("*"))[:2]), ("test", sorted(folder.glob("*"))[2:])):
        (tmp_path / place).mkdir()
        for path in files:
            shutil.copy(path, tmp_path / place)  # a recording and its sheet
    code, result, out, err = call("sysid", "--fit", "none", "--train", tmp_path / "train", "--test", tmp_path / "test")
    assert code == 0, err
    assert "SYNTHETIC" in out
    assert (len(result["train"]), len(result["test"])) == (1, 2)
    assert {row["truth"] for row in result["rows"]} == {"onboard", "mocap"}
    assert result["best"] in {row["model"] for row in result["rows"]}
    assert any("naive" in row["model"] for row in result["rows"])
    row = next(r for r in result["rows"] if (r["model"], r["truth"], r["group"]) == ("naive", "onboard", "all"))
    assert set(row["metrics"]["position_mae_m"]) == {"1", "10", "50", "sum"}
    assert (row["information"], row["n_flights"]) == ("state", 2)
    assert row["n_windows"] > 50
    assert result["parameters"]["published_physics"]["mass"] == {"value": 0.04085, "ci95": None, "unit": "kg"}


@pytest.mark.parametrize(("arguments", "says"), [
    (["estimate", "--protocol", "brownout"], "unknown protocol 'brownout'; known: as-published"),
    (["estimate", "--only", "--method", "nonsense"], "unknown estimator 'nonsense'; known:"),
    (["estimate", "--only", "--method", "json:JSONDecoder"], "json:JSONDecoder: is none of the estimators"),
    (["estimate", "--only", "--method", "json:loads"], "is none of the estimators"),
    (["estimate", "--trajectory-dir", "nowhere"], "--trajectory-dir nowhere: is no folder"),
    (["control", "--plant", "moon"], "unknown plant 'moon'; known: real, gate, simulated"),
    (["control", "--controller", "lqr", "--quiet"], "unknown controller of these recordings: 'lqr'; known: onboard_"),
    (["control", "--protocol", "x"], "unknown protocol 'x'; known: as-published, clean"),
    (["sysid", "--method", "nonsense"], "unknown predictor 'nonsense'"),
    (["sysid", "--train", "x"], "--train and --test go together")])
def test_bad_usage_is_one_line_and_exit_2(call, folder, arguments, says):
    code, result, _, err = call(*arguments, "--data", folder)
    assert (code, result) == (2, None)
    assert says in err
    assert len(err.strip().splitlines()) == 1


def test_too_little_data_is_one_line_that_names_the_place(call, folder, tmp_path):
    lone = tmp_path / "lone"
    lone.mkdir()
    lines = sorted(folder.glob("*.csv"))[0].read_text().splitlines()
    header = lines[0].split(",")
    keep = [i for i, name in enumerate(header) if not name.startswith("est_")]
    (lone / "f.csv").write_text("\n".join(",".join(line.split(",")[i] for i in keep) for line in lines) + "\n")
    code, _, _, err = call("estimate", "--data", lone, "--protocol", "clean", "--quiet")
    assert code == 2
    assert "f.csv" in err
    assert "estimator" in err
    assert len(err.strip().splitlines()) == 1


def test_an_own_estimator_beside_the_logged_one(call, folder, tmp_path, monkeypatch):
    (tmp_path / "mine_smooth.py").write_text(
        "import numpy as np\nfrom nanobench_tools import Estimate\n\n\nclass Smooth:\n    name = 'smooth'\n"
        "    causal = False\n\n    def estimate(self, flight):\n"
        "        s, q = flight['estimator'], flight['attitude_qw']\n"
        "        p = np.stack([np.convolve(s[c], np.ones(5) / 5, 'same') for c in 'xyz'], 1)\n"
        "        return Estimate(s.time_s, p, q['qx', 'qy', 'qz', 'qw'], s['vx', 'vy', 'vz'])\n")
    monkeypatch.chdir(tmp_path)
    code, result, _, err = call("estimate", "--data", folder, "--protocol", "clean", "--only", "--method",
                                "mine_smooth:Smooth",
                                "--method", "onboard_ekf")
    assert code == 0, err
    rows = {row["method"]: row for row in result["rows"] if row["group"] == "all"}
    assert set(rows) == {"smooth", "onboard_ekf"}
    assert "until 0.5 s" in rows["smooth"]["given"]
    assert rows["smooth"]["causal"] is False
    ratio = rows["smooth"]["metrics"]["ate_rmse_m"]["mean"] / rows["onboard_ekf"]["metrics"]["ate_rmse_m"]["mean"]
    assert 0.2 < ratio < 5.0


@pytest.mark.slow
@pytest.mark.real
def test_the_verbs_give_the_published_tables(call, real_data, audits_of):
    """On the fast slices of Task 3; the other groups are of ``test_task3_tables.py``."""
    slices = sorted((real_data / "nanobench" / "benchmarks" / "task3_stateEst").rglob("*_fast_*.csv.xz"))
    flights = load_recordings(slices).flights
    assert len([*audits_of(flights).values()]) == len(flights)  # from here on they are in the store
    data = [word for path in slices for word in ("--data", path)]
    code, result, _, err = call("estimate", *data, "--protocol", "as-published", "--quiet", "--only", "--method",
                                "onboard_ekf")
    assert code == 0, err
    assert not result["synthetic"]
    found = {row["group"]: (row["n"], round(1e3 * row["metrics"]["ate_rmse_m"]["mean"], 1),
                            round(row["metrics"]["attitude_rmse_deg"]["mean"], 2)) for row in result["rows"]}
    assert found == {"Fast": (7, 3142.7, 29.67)}

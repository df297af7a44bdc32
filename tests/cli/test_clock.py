"""--clock: the same scores as recorded, with the constant offset, and with the moving error taken out."""

import json
from types import SimpleNamespace

import pytest

from nanobench_tools.steps.options import clock_line


def scores(nanobench, folder, out, clock):
    code, _, err = nanobench("estimate", "--data", folder, "--protocol", "clean", "--only", "--method",
                             "onboard_ekf", "--clock",
                             clock, "--json", out, "--jobs", 1, "--quiet")
    assert code == 0, err
    row = next(r for r in json.loads(out.read_text())["rows"] if r["group"] == "all")
    assert row["clock"] == clock
    return {name: value["mean"] for name, value in row["metrics"].items()}, row["given"]


@pytest.mark.slow
def test_each_clock_removes_what_it_says(nanobench, wandering, tmp_path):
    recorded, _ = scores(nanobench, wandering, tmp_path / "a.json", "as-recorded")
    offset, given = scores(nanobench, wandering, tmp_path / "b.json", "offset")
    assert "constant offset" in given
    retimed, given = scores(nanobench, wandering, tmp_path / "c.json", "retimed")
    assert "gyro, acceleration, attitude against motion capture (attitude: gyro, acceleration)" in given
    assert recorded["delay_s"] - offset["delay_s"] == pytest.approx(0.04, abs=0.015)
    moving = "along_track_delay_removed_rmse_m"
    assert offset[moving] == pytest.approx(recorded[moving], rel=0.15)  # a constant cannot remove what moves
    assert retimed[moving] < 0.6 * recorded[moving]


@pytest.mark.slow
def test_rows_of_task_2_say_their_clock(nanobench, wandering, tmp_path):
    out = tmp_path / "o.json"
    code, _, err = nanobench("control", "--data", wandering, "--protocol", "clean", "--clock", "retimed", "--json", out,
                             "--jobs", 1, "--quiet")
    assert code == 0, err
    rows = json.loads(out.read_text())["rows"]
    assert {row["clock"] for row in rows} == {"retimed"}
    assert {tuple(row["clock_evidence"]) for row in rows} == {("gyro", "acceleration", "attitude")}


@pytest.mark.slow
def test_the_joint_clock_judges_no_logged_estimate(nanobench, wandering, tmp_path):
    code, _, err = nanobench("estimate", "--data", wandering, "--protocol", "clean", "--only", "--method",
                             "onboard_ekf",
                             "--clock", "joint")
    assert (code, err.strip().count("\n")) == (2, 0) or "cannot judge" in err.splitlines()[-1]
    code, _, err = nanobench("sysid", "--data", wandering, "--clock", "joint", "--fit", "none")
    assert code == 2
    assert "cannot judge the logged attitude" in err
    out = tmp_path / "j.json"
    code, _, err = nanobench("estimate", "--data", wandering, "--protocol", "blackout", "--only", "--method",
                             "drag_ekf",
                             "--clock", "joint", "--json", out, "--jobs", 1)
    assert code == 0, err
    row = json.loads(out.read_text())["rows"][0]
    assert set(row["clock_evidence"]) == {"gyro", "acceleration", "attitude", "velocity", "position"}
    assert "helped to set this clock" in row["given"]


@pytest.mark.slow
def test_the_published_table_is_never_retimed(nanobench, wandering):
    code, _, err = nanobench("estimate", "--data", wandering, "--protocol", "as-published", "--clock", "retimed")
    assert code == 2
    assert err.strip().count("\n") <= 1
    assert "the published table was made as recorded" in err


@pytest.mark.slow
def test_the_main_job_has_the_rows_of_the_verbs_on_each_clock_and_shows_them(nanobench, one_fit, wandering, tmp_path):
    code, _, err = nanobench("run", "--data", wandering, "--out", tmp_path / "all", "--jobs", 1, "--quiet")
    assert code in (0, 1), err  # too few recordings for Task 1
    body = json.loads((tmp_path / "all" / "estimate.json").read_text())
    clean = [r for r in body["rows"] if r["protocol"] == "clean" and r["method"] == "onboard_ekf"]
    assert len(clean) == len({(r["group"], r["clock"]) for r in clean})
    for clock in ("offset", "retimed"):
        expected, given = scores(nanobench, wandering, tmp_path / f"{clock}.json", clock)
        row = next(r for r in clean if (r["group"], r["clock"]) == ("all", clock))
        assert {name: value["mean"] for name, value in row["metrics"].items()} == expected
        assert row["given"] == given
        assert set(body["clocks"][clock]) == set(row["flights"])
    assert row["n_moving"] == sum(found["moving"] for found in body["clocks"]["retimed"].values()) > 0
    assert {p["clock"] for p in body["per_flight"]} == {"as-recorded", "offset", "retimed"}
    code, _, err = nanobench("estimate", "--data", wandering, "--protocol", "blackout", "--only", "--method",
                             "error_state_ekf",
                             "--clock", "retimed", "--json", tmp_path / "b.json", "--jobs", 1, "--quiet")
    assert code == 0, err
    verb = json.loads((tmp_path / "b.json").read_text())
    reckoned = [r for r in body["rows"] if (r["protocol"], r["method"]) == ("blackout", "error_state_ekf")]
    plain = [[{k: v for k, v in r.items() if "ratio" not in k} for r in rows if r["clock"] == "retimed"]
             for rows in (reckoned, verb["rows"])]  # the main job has more rows to compare with
    assert plain[0] == plain[1]
    assert {r["clock"] for r in reckoned} == {"as-recorded", "retimed"}
    assert {w["clock"] for w in body["windows"]} == {"as-recorded", "offset", "retimed", "joint"}
    page = (tmp_path / "all" / "report.html").read_text()
    assert "Dead reckoning, after the last pose." in page
    assert "constant offset removed, re-timed" in page
    assert "re-timed" in (tmp_path / "all" / "table_task3_clocks.tex").read_text()
    assert "clock" in (tmp_path / "all" / "table_task3_clean.csv").read_text("utf-8-sig").splitlines()[0].split(",")


@pytest.mark.slow
def test_the_main_job_on_one_clock_moves_clean_rows_and_no_published_ones(nanobench, one_fit, wandering, tmp_path):
    code, _, err = nanobench("run", "--data", wandering, "--out", tmp_path, "--jobs", 1, "--quiet", "--clock",
                             "retimed")
    assert code in (0, 1), err
    for name in ("estimate", "control"):
        rows = json.loads((tmp_path / f"{name}.json").read_text())["rows"]
        moved = ("clean", "blackout")
        assert {r["clock"] for r in rows if r["protocol"] in moved} == {"retimed"}
        assert {r["clock"] for r in rows if r["protocol"] not in moved} <= {"as-recorded"}
    assert (tmp_path / "report.html").exists()


def test_the_line_of_a_clock_counts_every_recording_once():
    moving, constant = SimpleNamespace(moving=True), SimpleNamespace(moving=False)
    assert clock_line("retimed", [moving, constant, None], ["gyro"], ("position", "velocity")) == (
        "clock retimed, for judging logged position and velocity, set by gyro: 1 with a moving error and "
        "1 with a constant error and 1 as recorded, no clock found (of 3)")
    assert clock_line("joint", [None, None], [], ()) == (
        "clock joint: no stream identifies the time error of any recording (2 as recorded)")

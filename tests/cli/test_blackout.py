"""estimate --protocol blackout: rows, windows, and what a clock does to them."""

import json
from statistics import median

import pytest

from nanobench_tools.protocols import blackout as protocol


def blackout(nanobench, folder, out, *more):
    code, _, err = nanobench("estimate", "--data", folder, "--protocol", "blackout", "--json", out, "--jobs", 1,
                             "--quiet", *more)
    assert code == 0, err
    return json.loads(out.read_text())


@pytest.mark.slow
def test_every_row_is_there_unasked(nanobench, wandering, tmp_path, monkeypatch):
    """One start a flight: what each row is worth is not asked here."""
    monkeypatch.setattr(protocol, "EVERY_S", 1000.0)
    body = blackout(nanobench, wandering, tmp_path / "a.json")
    assert {row["method"] for row in body["rows"]} == {
        "strapdown", "error_state_ekf", "drag_ekf", "drag_matrix_ekf", "invariant_ekf", "hold_position",
        "constant_velocity"}
    assert {w["method"] for w in body["windows"] if w["h_s"] == 5.0} == {row["method"] for row in body["rows"]}
    said = {w["method"] for w in body["windows"] if w["inside_3_sigma"] is not None}
    assert said == {"strapdown", "error_state_ekf", "drag_ekf", "drag_matrix_ekf", "invariant_ekf"}


@pytest.mark.slow
def test_windows_and_rows_agree(nanobench, wandering, tmp_path):
    body = blackout(nanobench, wandering, tmp_path / "a.json", "--only", "--method", "hold_position", "--method",
                    "constant_velocity", "--method", "drag_ekf")
    assert {row["method"] for row in body["rows"]} == {"hold_position", "constant_velocity", "drag_ekf"}
    for row in (r for r in body["rows"] if r["group"] == "all"):
        mine = [w for w in body["windows"] if w["method"] == row["method"] and w["h_s"] == 5.0]
        flights = {w["flight"] for w in mine}
        means = [sum(w["error_m"] for w in mine if w["flight"] == f) / sum(w["flight"] == f for w in mine)
                 for f in flights]
        assert row["metrics"]["end_error_5s_m"]["mean"] == pytest.approx(sum(means) / len(means))
        assert row["protocol"] == "blackout"
        whole = row["over_windows"]["end_error_5s_m"]
        assert whole["n"] == len(mine)
        assert whole["median"] == pytest.approx(median(w["error_m"] for w in mine))
        for window in mine:
            assert window["error_m"] ** 2 == pytest.approx(window["horizontal_m"] ** 2 + window["vertical_m"] ** 2)
        assert "until t0" in row["given"]
        assert len(mine[0]["end_m"]) == 3


def test_a_clock_can_be_taken_out(nanobench, wandering, tmp_path):
    def mean(body):
        row = next(r for r in body["rows"] if (r["method"], r["group"]) == ("error_state_ekf", "all"))
        return row["metrics"]["end_error_1s_m"]["mean"], row["clock"]

    only, one = ("--only", "--method", "error_state_ekf"), next(wandering.glob("*trefoil*.csv"))
    recorded = mean(blackout(nanobench, one, tmp_path / "a.json", *only))
    retimed = mean(blackout(nanobench, one, tmp_path / "b.json", *only, "--clock", "retimed"))
    assert (recorded[1], retimed[1]) == ("as-recorded", "retimed")
    assert retimed[0] < recorded[0]


def test_it_is_not_run_unasked(nanobench, wandering, tmp_path):
    out = tmp_path / "c.json"
    assert nanobench("estimate", "--data", wandering, "--only", "--method", "hold_position", "--json", out, "--jobs", 1,
                     "--quiet")[0] == 0
    assert "windows" not in json.loads(out.read_text())


@pytest.mark.slow
def test_pictures_and_attribution(nanobench, recordings, tmp_path):
    """One flight and one window of every estimator that says how sure it is; what the onboard error comes from."""
    out = tmp_path / "d.json"
    code, shown, err = nanobench("estimate", "--data", recordings, "--protocol", "aided", "--protocol", "blackout",
                                 "--only", "--method", "drag_ekf", "--method", "hold_position", "--attribution",
                                 "--json", out, "--jobs", 1, "--verbose")
    assert code == 0, err
    body = json.loads(out.read_text())
    assert [(band["protocol"], band["method"]) for band in body["bands"]] == [("aided", "drag_ekf"),
                                                                              ("blackout", "drag_ekf")]
    assert len(body["bands"][0]["t_s"]) == len(body["bands"][0]["sd_m"])
    assert [row["what"] for row in body["attribution"]["logged"]] == ["as-recorded", "offset", "retimed"]
    assert body["attribution"]["n_replayed"] == 3
    assert "SYNTHETIC" in shown
    assert "process noise doubled" in shown


def test_the_tables_say_sessions_windows_and_who_set_the_clock(nanobench, wandering, monkeypatch):
    """As a pipe sees them: every cell whole; voters in the titles and in what was given."""
    monkeypatch.setattr(protocol, "EVERY_S", 1000.0)
    code, shown, err = nanobench("estimate", "--data", wandering, "--protocol", "blackout", "--only", "--method",
                                 "drag_ekf",
                                 "--clock", "retimed", "--jobs", 1, "--verbose")
    assert code == 0, err
    said = " ".join(shown.split())
    assert "found off-line from gyro, acceleration, attitude against motion capture" in said
    row = next(line for line in shown.splitlines() if "3-D" in line).split()
    assert row[:4] == ["all", "drag_ekf", "retimed", "3-D"]
    assert "does not show how sure a median is" in said
    assert "…" not in shown

"""``estimate --tune-onboard``: the verb on flights of the package, and what it does not go with. SYNTHETIC."""

import json
import tomllib

import pytest

from nanobench_tools.cli.main import main


def test_it_goes_with_no_other_method(capsys):
    assert main(["estimate", "--tune-onboard", "--method", "drag_ekf"]) == 2
    assert "--tune-onboard goes with" in capsys.readouterr().err


@pytest.mark.slow
def test_parameters_are_written_for_practice_flights(tmp_path, capsys):
    assert main(["simulate", "--out", str(tmp_path / "flights"), "--flights", "2", "--seconds", "14"]) == 0
    assert main(["estimate", str(tmp_path / "flights"), "--tune-onboard", "--out", str(tmp_path / "out"),
                 "--jobs", "1"]) == 0
    told = tomllib.loads((tmp_path / "out" / "onboard_parameters.toml").read_text())["parameters"]
    assert 0.2 < told["kalman.dragB_x"] < 0.6
    body = json.loads((tmp_path / "out" / "tune_onboard.json").read_text())
    rows = {row["what"]: row for row in body["rows"] if row["clock"] == "retimed"}
    assert rows["with drag"]["ratios"]["end_1s_m"]["ratio"] < 1.0
    assert "kalman.dragB_x" in capsys.readouterr().out

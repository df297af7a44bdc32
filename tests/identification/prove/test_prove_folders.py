"""Proof on folders: labels, scoring, blindness, and the command on real flights."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "mismatch"))
from hover_flights import hover

from identification.prove.condition_labels import Label, read_labels
from identification.prove.folder_score import dose_and_response, score_folder
from identification.prove.folders import judge
from nanobench_tools.cli.main import main
from nanobench_tools.cli.real_folders import copies_between
from nanobench_tools.errors import InputError
from nanobench_tools.harness import run_items
from nanobench_tools.physics.simulator import read_simulator

HEAD = 'schema = "nanobench-labels/1"\n[folders.normal]\ncause = "normal"\n'


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_labels_are_read(tmp_path):
    text = HEAD + '[folders.a]\ncause = "propeller"\nmotors = [3]\ncut_mm = [[2.0, 2]]\n'
    labels = read_labels(written(tmp_path / "labels.toml", text))
    assert labels["a"] == Label("propeller", (3,), ((2.0, 2.0),))


@pytest.mark.parametrize(("text", "words"), [
    ("nonsense", "is not TOML"), ('schema = "other/1"\n', "schema is 'other/1'"),
    (HEAD.replace("normal", "tape"), "no folder"),
    (HEAD + '[folders.a]\ncause = "gremlins"\n', r"\[folders.a\]: cause is 'gremlins'; known: normal"),
    (HEAD + '[folders.a]\ncause = "tape"\nmotors = [5]\n', "motors is"),
    (HEAD + '[folders.a]\ncause = "tape"\nmotor = [1]\n', "unknown key 'motor'"),
    (HEAD + '[folders.a]\ncause = "propeller"\ncut_mm = [1.0]\n', "cut_mm is")])
def test_bad_labels_are_one_line(tmp_path, text, words):
    with pytest.raises(InputError, match=words) as error:
        read_labels(written(tmp_path / "labels.toml", text))
    assert "\n" not in str(error.value)


def verdict(*findings, outcome="named", change=(0.0, 0.0, 0.2, 0.0)):
    return {"outcome": outcome, "findings": [{"term": "t", "cause": c, "causes": cs, "motors": m, "confidence": 0.95}
                                             for c, cs, m in findings],
            "power": {"propeller": {"minimum_detectable": 12.0, "unit": "%"}}, "paragraph": "", "elapsed_s": 1.0,
            "improvement": None, "trim": {"change_percent": [100 * c for c in change], "sd_percent": 2.0}}


def test_scores():
    cut = Label("propeller", (3,), ((2.0, 2.0),))
    right = score_folder("a", cut, verdict(("propeller", ["propeller"], [3])), False)
    assert right.right
    assert not right.false_name
    assert right.size.loss_percent == (pytest.approx(18.13, abs=0.01),)
    wrong_motor = score_folder("a", cut, verdict(("propeller", ["propeller"], [2])), False)
    assert wrong_motor.false_name
    assert not wrong_motor.right
    wrong = score_folder("a", cut, verdict(("weight", ["weight"], [3])), False)
    assert wrong.false_name
    assert not wrong.right
    both = score_folder("a", Label("mass"), verdict((None, ["mass", "battery"], [])), False)
    assert not both.false_name
    assert not both.right
    quiet = score_folder("a", cut, verdict(outcome="none", change=(0.0, 0.0, 0.05, 0.0)), False)
    assert quiet.below
    assert not quiet.right
    assert not quiet.false_name
    alarm = score_folder("a", Label("normal"), verdict(("propeller", ["propeller"], [1])), False)
    assert alarm.false_name
    assert not alarm.right
    strange = score_folder("a", Label("normal"), verdict(("vehicle", ["vehicle"], [])), True)
    assert strange.right
    assert not strange.false_name


def test_dose_and_response_are_ranked():
    def case(cut, loss):
        made = score_folder("a", Label("propeller", (3,), ((cut, 0.0),)), verdict(outcome="none"), False)
        return replace(made, size=replace(made.size, loss_percent=(loss,)))

    found = dose_and_response([case(1.0, 2.0), case(2.0, 1.0), case(3.0, 9.0)])
    assert found.one_motor.spearman == pytest.approx(0.5)
    assert dose_and_response([case(1.0, 2.0)]).one_motor.spearman is None


def test_copies_stay_with_the_first_group():
    a, b, c = (hover(n) for n in ("a", "b", "c"))
    found = copies_between({"normal": [a], "cut": [b, c]}, [["b", "a"]])
    assert set(found) == {"b"}
    assert "the same numbers as a of normal" in found["b"]


@pytest.fixture(scope="module")
def judged():
    rng = np.random.default_rng(3)
    day = [0.01 * rng.standard_normal(4) for _ in range(4)]
    normal = [hover(f"usual{k}", d, seed=k) for k, d in enumerate(day)]
    lost = -np.log1p(-0.25) * np.eye(4)[1]
    folders = {"cut_of_2": [hover(f"cut{k}", lost, seed=20 + k) for k in range(2)],
               "same": [hover(f"same{k}", seed=30 + k) for k in range(2)],
               "grounded": [hover("low", seed=40, on=False)]}
    seen = []

    def run(items, title):
        seen.extend(i for i in items if title == "diagnose")
        return run_items(items)

    return judge(folders, normal, run, 0, mass_kg=0.034), seen


@pytest.mark.slow
def test_folders_are_diagnosed_blind(judged):
    found, items = judged
    assert found.verdicts["cut_of_2"]["findings"][0]["motors"] == [2]
    assert found.verdicts["same"]["outcome"] == "none"
    assert found.verdicts["grounded"]["outcome"] == "insufficient"
    assert "low" in found.verdicts["grounded"]["paragraph"]
    assert all(not v["findings"] for v in found.alarms.values())
    assert set(found.alarms) == {f"usual{k}" for k in range(4)}
    for item in items:
        shown = json.dumps({"flights": item.kwargs["flights"], "normal": item.kwargs["normal"]})
        assert "cut" not in shown
        assert "usual" not in shown
        assert "cut" not in item.label


def test_bad_calls_are_one_line(tmp_path, capsys):
    labels = written(tmp_path / "labels.toml", HEAD)
    (tmp_path / "set" / "cut").mkdir(parents=True)
    for given, words in ((["--real", tmp_path / "set"], "--labels"),
                         (["--real", tmp_path / "set", "--labels", labels], "has no folder 'normal'"),
                         (["--real", tmp_path / "none", "--labels", labels], "is no folder"),
                         (["--real", tmp_path / "set", "--labels", tmp_path / "x"], "does not exist"),
                         (["--labels", labels], "belong to --real")):
        assert main(["prove", *map(str, given), "--quiet"]) == 2
        said = capsys.readouterr().err.strip()
        assert words in said
        assert "\n" not in said


@pytest.mark.real
@pytest.mark.slow
def test_real_cut_of_three_millimetres_is_named(real_data, tmp_path):
    place = tmp_path / "set"
    place.mkdir()
    for name in ("normal", "cut_propeller_M3_3mm_3mm_41mm"):
        (place / name).symlink_to(real_data / "crazypad" / "E8" / name)
    given = ["--real", place, "--labels", real_data / "crazypad" / "labels.toml", "--out", tmp_path, "--jobs", 1]
    assert main(["prove", *map(str, given), "--quiet"]) == 0
    cases = {c["case"]: c for c in json.loads((tmp_path / "prove.json").read_text())["cases"]}
    cut = cases["cut_propeller_M3_3mm_3mm_41mm"]
    assert (cut["cause"], cut["motors_named"], cut["right"]) == ("propeller", [3], True)
    assert not any(c["false_name"] for c in cases.values())
    assert sum(name.startswith("normal, left out") for name in cases) == 5


@pytest.mark.real
@pytest.mark.slow
def test_real_folder_against_normal_ones(real_data, tmp_path, capsys):
    vehicle = real_data / "crazypad" / "E8"
    given = ["--data", vehicle / "cut_propeller_M3_2mm_2mm_43mm", "--normal", vehicle / "normal", "--out", tmp_path,
             "--jobs", 1]
    assert main(["diagnose", *map(str, given)]) == 0
    verdict = json.loads((tmp_path / "verdict.json").read_text())
    assert verdict["findings"][0]["motors"] == [3]
    assert "The propeller of motor 3 (back left) lost thrust" in " ".join(capsys.readouterr().out.split())
    believed, better = (read_simulator(tmp_path / f"simulator_{n}.toml") for n in ("normal", "corrected"))
    gains = [m.as_dict()["motor_imbalance"]["g"] for m in (believed, better)]
    shares = [g[2] / (g[0] + g[1] + g[3]) for g in gains]
    loss = verdict["findings"][0]["parameters"]["loss_m3"]["value"] / 100.0
    assert shares[1] / shares[0] == pytest.approx(1.0 - loss, rel=1e-6)
    given = ["--data", vehicle / "cut_propeller_M3_2mm_2mm_43mm", "--simulator", tmp_path / "simulator_normal.toml",
             "--out", tmp_path / "again", "--jobs", 1, "--quiet"]
    assert main(["diagnose", *map(str, given)]) == 0
    again = json.loads((tmp_path / "again" / "verdict.json").read_text())
    assert (again["findings"][0]["cause"], again["findings"][0]["motors"]) == ("propeller", [3])

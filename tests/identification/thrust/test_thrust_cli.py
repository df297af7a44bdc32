"""The verb: its result file, its page, and one line for whatever cannot be fitted."""

import json
import re

import numpy as np
import pytest
from made_stands import dc_law, drive, text

from nanobench_tools.cli.main import main


@pytest.fixture
def nanobench(capsys):
    def call(*arguments):
        code = main(["thrust", *map(str, arguments), "--jobs", "1"])
        found = capsys.readouterr()
        return code, found.out, found.err

    return call


def series(folder, *seeds):
    folder.mkdir(exist_ok=True)
    for seed in seeds:
        u, voltage = drive(seed=seed)
        noise = 5e-4 * np.random.default_rng(seed).normal(size=len(u))
        (folder / f"s{seed}.csv").write_text(text(u, voltage, dc_law(u, voltage) + noise))
    return folder


@pytest.mark.slow
def test_train_and_test(tmp_path, nanobench):
    code, out, err = nanobench("--train", series(tmp_path / "a", 1, 2), "--test", series(tmp_path / "b", 3),
                               "--out", tmp_path / "out", "--json", tmp_path / "r.json")
    assert (code, "Traceback" in err) == (0, False)
    found = json.loads((tmp_path / "r.json").read_text())
    assert found["schema"] == "nanobench-thrust/1"
    rows = {(r["model"], r["split"]): r for r in found["rows"]}
    best = rows[found["best"], "test"]
    assert best["rms_N"] < 1e-3
    assert best["rms_N"] < rows["thrust_pwm", "test"]["rms_N"]
    assert all(best["rms_N"] < r["rms_N"] for (m, s), r in rows.items() if m.startswith("firmware") and s == "test")
    assert best["n"] == 120
    assert set(found["parameters"][found["best"]].popitem()[1]) >= {"value", "ci95", "unit"}
    assert "best map: DC motor" in out
    assert "rows of a file that was held out" in out
    page = (tmp_path / "out" / "thrust.html").read_text()
    assert "http://" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert found["best"] in page
    assert (tmp_path / "out" / "terms.toml").read_text().startswith("[[terms]]")


@pytest.mark.slow
def test_without_a_split_every_series_is_held_out(tmp_path, nanobench):
    code, _, _ = nanobench("--data", series(tmp_path / "a", 1, 2, 3), "--json", tmp_path / "r.json")
    found = json.loads((tmp_path / "r.json").read_text())
    assert code == 0
    assert set(found["stand"]["held_out"]) == {"s1", "s2", "s3"}
    assert all(len(h["fitted_to"]) == 2 for h in found["stand"]["held_out"].values())


def silenced(tmp_path, nanobench):
    """Result and messages of two series and one whose load cell says nothing."""
    data = series(tmp_path / "a", 1, 2)
    u, voltage = drive()
    (data / "silent.csv").write_text(text(u, voltage, 0.0 * u))
    code, _, err = nanobench("--data", data, "--json", tmp_path / "r.json")
    assert code == 0
    return json.loads((tmp_path / "r.json").read_text()), err


@pytest.mark.slow
def test_with_a_silent_load_cell_the_result_is_the_same_as_without_it(tmp_path, nanobench):
    """The same numbers to the last digit: the same seed gives the same result."""
    found, _ = silenced(tmp_path, nanobench)
    (tmp_path / "a" / "silent.csv").unlink()
    assert nanobench("--data", tmp_path / "a", "--json", tmp_path / "alone.json", "--quiet")[0] == 0
    alone = json.loads((tmp_path / "alone.json").read_text())
    assert all(found[key] == alone[key] for key in ("rows", "parameters", "best"))


@pytest.mark.slow
def test_a_silent_load_cell_is_said_and_left_out(tmp_path, nanobench):
    found, err = silenced(tmp_path, nanobench)
    assert [entry["flight"] for entry in found["left_out"]] == ["silent"]
    assert "left out: silent: holds no thrust" in err
    assert all(r["files"] == 2 for r in found["rows"])


@pytest.mark.parametrize(("arguments", "said"), [
    (("--train", "a"), "--train and --test go together"),
    (("--mass", "40.85"), "is it in grams?"),
    (("--data", "nowhere"), "does not exist"),
])
def test_bad_usage(tmp_path, monkeypatch, nanobench, arguments, said):
    monkeypatch.chdir(tmp_path)
    code, _, err = nanobench(*arguments)
    assert code == 2
    assert said in err
    assert len(err.strip().splitlines()) == 1


def test_nothing_to_fit_is_one_line(tmp_path, nanobench):
    folder = tmp_path / "a"
    folder.mkdir()
    u, voltage = drive()
    (folder / "silent.csv").write_text(text(u, voltage, 0.0 * u))
    code, _, err = nanobench("--data", folder, "--quiet")
    assert code == 2
    assert len(err.strip().splitlines()) == 1
    assert "nothing to fit" in err


@pytest.mark.slow
def test_training_files_that_cannot_be_read_are_listed_and_the_others_fitted(tmp_path, nanobench):
    train = series(tmp_path / "a", 1, 2)
    (train / "torn.csv").write_bytes(b"\x00\x01\x02" * 50)
    (train / "notes.csv").write_text("who,what\nme,nothing\n")
    code, out, err = nanobench("--train", train, "--test", series(tmp_path / "b", 3), "--json", tmp_path / "r.json")
    assert code == 1
    found = json.loads((tmp_path / "r.json").read_text())
    assert sorted(f["file"].rpartition("/")[2] for f in found["failed"]) == ["notes.csv", "torn.csv"]
    assert sum(line.startswith("failed: read: ") for line in err.splitlines()) == 2
    whole = nanobench("--train", train / "s1.csv", "--train", train / "s2.csv", "--test", tmp_path / "b", "--json",
                      tmp_path / "w.json")
    assert whole[0] == 0
    assert found["rows"] == json.loads((tmp_path / "w.json").read_text())["rows"]
    assert "best map: " in out


def test_one_file_without_voltage_states_no_voltage_and_what_was_held_out(tmp_path, nanobench):
    """A racer's motor: 19 N are possible for a file that does not say its voltage."""
    u = np.linspace(0.1, 1.0, 40)
    rows = "\n".join(f"{1000 + 1000 * v:.1f},{19.0 * v**2:.4f}" for v in u)
    (tmp_path / "a.csv").write_text(f"ESC signal (us),Thrust (N)\n{rows}\n")
    code, out, err = nanobench("--data", tmp_path / "a.csv")
    assert code == 0
    said = " ".join((out + err).split())
    assert "The rows have no voltage" in said
    assert "nan V" not in said
    assert "pieces of the only file held out in turn" in said

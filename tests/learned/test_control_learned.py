"""``control --learned all`` from the command line: rows, correction by the teacher, tuned gains, what fails."""

import contextlib
import functools
import io
import json

import pytest

from controllers.learned import pilots, policies, rollouts
from controllers.learned.mppi import MppiSettings
from identification.learned.training import Settings
from nanobench_tools.cli.main import main
from nanobench_tools.sources.nanobench_writer import write_nanobench

GAINS = """schema = "nanobench-gains/1"
controller = "controllers.learned.pilots:MppiFar"
better = false

[gains]
noise = 0.05
"""


@pytest.fixture(scope="module")
def places(tmp_path_factory, crowd):
    """Folder with four practice recordings (SYNTHETIC), gains, and a folder for results; a torn checkpoint is in it."""
    data, out = tmp_path_factory.mktemp("data"), tmp_path_factory.mktemp("out")
    for name in ("circle", "trefoil", "helix", "medium trefoil"):
        write_nanobench(crowd.flight(name), data / f"{name.replace(' ', '_')}.csv")
    (data.parent / "gains.toml").write_text(GAINS)
    (out / "learned").mkdir()
    (out / "learned" / "bc_lstm.safetensors").write_bytes(b"torn")
    return data, data.parent / "gains.toml", out


@pytest.fixture(scope="module")
def job(places):
    """(exit code, stdout, stderr, JSON) of the verb with short trainings and few rollouts, a teacher and gains."""
    data, gains, out = places
    said = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        for kind in policies.KINDS:
            patch.setitem(policies.SETTINGS, kind, Settings(epochs=3, batch=64, share=0.5))
        for module in (pilots, rollouts):  # as published it plans 128 rollouts of 10 steps
            patch.setattr(module, "MppiSettings", functools.partial(MppiSettings, horizon=2, samples=4))
        patch.setattr(pilots.MppiFar, "start", MppiSettings(horizon=5, samples=8, step_s=0.02, first=0.8, price=0.0))
        with contextlib.redirect_stdout(said[0]), contextlib.redirect_stderr(said[1]):
            code = main(["control", "--learned", "all", "--data", str(data), "--out", str(out), "--json",
                         str(out / "all.json"), "--jobs", "1", "--plants", "2", "--seconds", "7", "--dagger", "1",
                         "--gains", str(gains), "--verbose"])
    assert (out / "all.json").exists(), said[1].getvalue()
    return code, said[0].getvalue(), said[1].getvalue(), json.loads((out / "all.json").read_text())


@pytest.mark.slow
def test_rows_of_both_plants_with_published_numbers_and_the_error_bar(job):
    code, out, err, body = job
    assert code == 1, err  # bc_lstm is torn
    assert "SYNTHETIC" in out
    learned = {row["controller"]: row for row in body["rows"] if row["plant"] == "learned" and "published" in row}
    assert set(learned) == {"bc_mlp", "mppi"}
    assert all(row["published_n"] >= 1 and row["n"] == 1 for row in learned.values())
    flown = {row["controller"]: row for row in body["rows"] if row["plant"] == "simulated"}
    assert set(flown) == {"bc_mlp", "mppi_learned", "mppi", "mppi_far", "bc_mlp_dagger", "mppi_far tuned"}
    for row in flown.values():
        assert (row["n"], row["error_bar"]["of"]) == (2, "held-out recordings, as shipped")
        assert 0.0 < row["statistics"]["kept_s"]["median"] <= 11.0
    assert flown["mppi_far"]["metrics"] != flown["mppi_far tuned"]["metrics"]
    assert "these were not shown to be better than controllers.learned.pilots:MppiFar's own" in err


@pytest.mark.slow
def test_a_checkpoint_that_is_torn_fails_alone_in_one_line(job, places):
    _, _, err, body = job
    assert [f["item"] for f in body["failed"]] == ["train bc_lstm"]
    assert "is no whole checkpoint" in body["failed"][0]["error"]
    assert not [row for row in body["rows"] if "lstm" in row["controller"]]
    assert sum("bc_lstm" in line for line in err.splitlines()) == 1
    assert (places[2] / "learned" / "bc_lstm.safetensors").read_bytes() == b"torn"  # it is left for the user to remove


@pytest.mark.slow
def test_the_teacher_corrects_on_paths_that_do_not_judge(job, places):
    body = job[3]
    taught = body["learned"]["bc_mlp_dagger"]
    assert taught["epochs"] == 3
    assert {row["reference"] for row in body["rows"] if row["plant"] == "simulated"} == {"trefoil"}
    assert (places[2] / "learned" / "bc_mlp_dagger_1_of_1.safetensors").exists()
    assert (places[2] / "learned_commands.html").stat().st_size > 1000


@pytest.mark.slow
@pytest.mark.parametrize(("keep", "says"), [(1, "1 flights of the onboard PID to learn from"),
                                            (0, "0 flights of the onboard PID to learn from")])
def test_too_few_flights_are_one_line(places, tmp_path, capsys, keep, says):
    files = [path for path in sorted(places[0].iterdir()) if path.stem.startswith("circle")]
    assert len(files) == 2
    for path in files:
        text = path.read_text()
        if keep == 0 and path.suffix == ".csv":
            text = "\n".join(text.splitlines()[:150]) + "\n"  # the audit finds it never flew
        (tmp_path / path.name).write_text(text)
    code = main(["control", "--learned", "all", "--data", str(tmp_path), "--jobs", "1", "--quiet"])
    err = capsys.readouterr().err
    assert code == 2
    assert says in err
    assert err.count("\n") == 1

"""``nanobench report`` makes the page again from the result files of a folder."""

import json

import pytest

from nanobench_tools.cli.main import main
from nanobench_tools.results.result_files import write_json
from nanobench_tools.sources.nanobench_writer import write_nanobench


def call(capsys, *arguments):
    code = main([str(a) for a in arguments])
    return code, capsys.readouterr().err.strip()


@pytest.fixture
def folder(tmp_path, monkeypatch, results):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NANOBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("NANOBENCH_DATA", raising=False)
    out = tmp_path / "out"
    out.mkdir()
    for name, body in results.items():
        write_json(out / f"{name}.json", body)
    return out


def test_the_page_comes_back_from_the_files_alone(folder, capsys):
    code, _ = call(capsys, "report", "--out", folder, "--quiet")
    assert code == 0
    text = (folder / "report.html").read_text("utf-8")
    assert "there are no pictures of single flights" in text
    assert (folder / "table_task3.csv").exists()


def test_recordings_are_found_by_content_and_named_as_in_the_audit(folder, tmp_path, capsys, make):
    from nanobench_tools.sources.discover import load_recordings

    data = tmp_path / "data"
    data.mkdir()
    write_nanobench(make.flight(), data / "called otherwise.csv")
    flight = load_recordings([data]).flights[0]
    body = json.loads((folder / "audit.json").read_text())
    body["flights"][1]["sha256"] = flight.provenance.sha256
    write_json(folder / "audit.json", body)
    code, said = call(capsys, "report", folder, "--data", data)  # as the next command of estimate names them
    assert code == 0
    assert "1 of 2 recordings of audit.json were not found, loop one for one" in said
    assert '<option value="0" selected>loop two</option>' in (folder / "report.html").read_text("utf-8")


def test_the_screen_answers_before_the_page(folder, capsys, results):
    """The usable recordings of audit.json first, as on the page."""
    assert main(["report", "--out", str(folder)]) == 0
    out = capsys.readouterr().out
    judged = [f for f in results["audit"]["flights"] if f["severity"]]
    good = sum(f["severity"] != "unusable" for f in judged)
    assert "Recordings usable" in out
    assert f"{good} of {len(judged)}" in out
    assert out.index("Recordings usable") < out.index("report.html")


def test_an_empty_default_place_costs_only_the_pictures(folder, tmp_path, capsys):
    (tmp_path / "data").mkdir()
    code, said = call(capsys, "report", "--out", folder)
    assert code == 0
    assert "no recordings in the default places" in said


def test_simulated_results_make_a_labelled_page(folder, capsys, results):
    write_json(folder / "control.json", {**results["control"], "synthetic": True})
    call(capsys, "report", "--out", folder, "--quiet")
    assert "<h1><b class=\"label\">SYNTHETIC</b>" in (folder / "report.html").read_text("utf-8")


@pytest.mark.parametrize(("prepare", "said"), [
    (lambda out: ["report"], "report needs --out DIR"),
    (lambda out: ["report", "--out", out / "missing"], "is no folder"),
    (lambda out: ["report", "--out", out.parent], "holds no result file"),
    (lambda out: (out / "audit.json").write_text("{\n broken") and ["report", "--out", out], "audit.json: line 2"),
    (lambda out: (out / "sysid.json").write_text("[]") and ["report", "--out", out], "sysid.json: holds no JSON"),
    (lambda out: ["report", "--out", out, "--data", out / "gone"], "gone: does not exist"),
])
def test_bad_folders_end_in_one_line_that_names_the_place(folder, capsys, prepare, said):
    code, line = call(capsys, *prepare(folder))
    assert code == 2
    assert said in line
    assert "\n" not in line

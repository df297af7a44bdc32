"""``control --learned`` needs no value and hands over the flights; the slow tests train and fly."""

import json
from types import SimpleNamespace

import pytest

from nanobench_tools.steps.options import Options
from nanobench_tools.steps.result_bodies import Lessons


@pytest.mark.parametrize("words", [["--learned"], ["--learned", "all"], ["--learned", "--dagger", "2"]])
def test_learned_needs_no_value(nanobench, tmp_path, monkeypatch, words):
    given = []

    def rows(options, flights, audits, chosen, paths, members, summary, rounds, gains):
        given.append((flights, [path.family for path in paths], rounds))
        return [], Lessons({}, ["a"], ["b"], ["c"])

    flights = [SimpleNamespace(name="a", provenance=SimpleNamespace(synthetic=True))]
    monkeypatch.setattr("identification.learned.libraries.share_process", lambda: None)
    monkeypatch.setattr("nanobench_tools.cli.control_learned.learned_rows", rows)
    monkeypatch.setattr(Options, "load", lambda self: flights)
    monkeypatch.setattr(Options, "audit", lambda self, flights: ({}, []))
    code, _, err = nanobench("control", tmp_path, *words, "--json", tmp_path / "c.json")
    assert (code, err) == (0, "")
    ((read, families, rounds),) = given
    assert (read, families, rounds) == (flights, ["trefoil"], 2 if "--dagger" in words else 0)
    assert json.loads((tmp_path / "c.json").read_text())["learned"]["train"] == ["a"]

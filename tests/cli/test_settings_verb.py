"""``nanobench settings``."""

from __future__ import annotations

import json
import re

from nanobench_tools.settings import areas, everything, literals, models


def test_the_verb_lists_them(nanobench, tmp_path):
    code, out, err = nanobench("settings", "--json", tmp_path / "s.json", "--origins", "--unexplained")
    assert (code, err) == (0, "")
    body = json.loads((tmp_path / "s.json").read_text())
    assert body["schema"] == "nanobench-settings/1"
    assert body["version"]
    assert [entry["key"] for entry in body["settings"]] == list(everything())
    assert {entry["file"] for entry in body["models"]} == {model.file for model in models()}
    assert body["unexplained"] == literals.by_module(literals.unexplained())
    for key in everything():
        assert key in out
    assert f"{len(everything())} settings;" in out
    assert all(entry["set_on"] for entry in body["settings"])


def test_the_verb_takes_areas_and_refuses_others(nanobench):
    code, out, _ = nanobench("settings", "audit")
    assert code == 0
    keys = re.findall(r"^ ?([a-z]+)\.[a-z_]+\.", out, re.MULTILINE)
    assert keys
    assert set(keys) == {"audit"}
    code, _, err = nanobench("settings", "adit")
    assert code == 2
    assert err.strip().splitlines() == [err.strip()]
    assert "audit" in err
    assert "audit" in areas()


def test_origins_and_unexplained_numbers_keep_to_the_area(nanobench, tmp_path):
    """Against a search of the source text: who asks for settings of retiming."""
    asking = {module for module, text in literals.sources()
              if re.search(r"^[^\"#]*(number|count|setting)\(\"retiming\.", text, re.MULTILINE)}
    assert {"nanobench_tools/retiming/steps.py", "nanobench_tools/retiming/sender_timestamps.py"} < asking
    code, _, _ = nanobench("settings", "retiming", "--origins", "--unexplained", "--json", tmp_path / "s.json")
    body = json.loads((tmp_path / "s.json").read_text())
    assert code == 0
    assert body["origins"]
    assert {origin["where"].partition(":")[0] for origin in body["origins"]} <= asking
    assert set(body["unexplained"]) <= asking
    everywhere = {origin.where for origin in literals.origins() if origin.where.partition(":")[0] in asking}
    assert {origin["where"] for origin in body["origins"]} == everywhere

"""``nanobench settings``."""

import json
import re

from nanobench_tools.settings import areas, everything, models


def test_the_verb_lists_them(nanobench, tmp_path):
    code, out, err = nanobench("settings", "--verbose", "--json", tmp_path / "s.json")
    assert (code, err) == (0, "")
    body = json.loads((tmp_path / "s.json").read_text())
    assert body["schema"] == "nanobench-settings/1"
    assert body["version"]
    assert [entry["key"] for entry in body["settings"]] == list(everything())
    assert {entry["file"] for entry in body["models"]} == {model.file for model in models()}
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

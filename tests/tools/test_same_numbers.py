"""The comparison of result folders, by folders that differ in one known place."""

import json
import math

import pytest

from tools.same_numbers import compare, main

RESULT = {"rows": [{"flight": "a", "rmse_m": 0.1, "n": 3, "nothing": None}], "manifest": {"commit": "one"},
          "flag": True, "elapsed_s": 1.0}


def folders(tmp_path, after, name="sub/task.json"):
    for folder, value in (("before", RESULT), ("after", after)):
        path = tmp_path / folder / ("sub/task.json" if folder == "before" else name)
        path.parent.mkdir(parents=True)
        path.write_text(json.dumps(value))
    return tmp_path / "before", tmp_path / "after"


def changed(**row):
    return {**RESULT, "rows": [{**RESULT["rows"][0], **row}]}


def test_times_places_and_commits_do_not_count(tmp_path):
    before, after = folders(tmp_path, {**RESULT, "manifest": {"commit": "two"}, "elapsed_s": 9.0})
    assert compare(before, after) == []
    assert main([str(before), str(after)]) == 0


def test_the_last_digit_counts(tmp_path, capsys):
    before, after = folders(tmp_path, changed(rmse_m=math.nextafter(0.1, 1.0)))
    (found,) = compare(before, after)
    assert found.where == "sub/task.json/rows[0]/rmse_m"
    assert 0.0 < found.relative < 3e-16
    assert main([str(before), str(after)]) == 1
    assert "1 numbers differ" in capsys.readouterr().out


def test_a_difference_has_the_size_of_the_larger_number(tmp_path):
    (found,) = compare(*folders(tmp_path, changed(rmse_m=0.2)))
    assert found.relative == pytest.approx(0.5)


@pytest.mark.parametrize("after", [
    changed(flight="b"), changed(nothing=0.0), changed(n=None), changed(more=1), {**RESULT, "flag": 1},
    {**RESULT, "rows": []}, {k: v for k, v in RESULT.items() if k != "flag"},
])
def test_what_is_no_pair_of_numbers_is_a_difference(tmp_path, after):
    assert [d.relative for d in compare(*folders(tmp_path, after))] == [math.inf]


def test_a_file_on_one_side_only_is_a_difference(tmp_path):
    assert len(compare(*folders(tmp_path, RESULT, "sub/other.json"))) == 2


def test_an_empty_folder_proves_nothing(tmp_path, capsys):
    before, after = folders(tmp_path, RESULT)
    (after / "sub/task.json").unlink()
    assert main([str(before), str(after)]) == 2
    assert "holds no JSON file" in capsys.readouterr().err

"""Result files: plain JSON, whole or absent, and one line for anything wrong with them."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, make_dataclass
from pathlib import Path

import numpy as np
import pytest

from nanobench_tools import InputError, __version__
from nanobench_tools.harness import envelope, manifest, read_json, write_json
from nanobench_tools.harness.manifest import portable
from nanobench_tools.results.result import INLINE, OPTIONAL, Result, from_json, named, to_json
from nanobench_tools.results.result_files import sweep


@dataclass(frozen=True)
class Reading:
    offset_s: float
    path: Path


def test_numbers_become_plain_json(tmp_path):
    value = {"a": np.float32(0.5), "b": np.arange(3), "c": float("nan"), "d": [np.inf, -np.inf], "e": np.bool_(True),
             "f": Reading(np.float64(1), Path("x/y")), 7: (1, 2), "g": {"β"}, "h": np.array([[1.0, np.nan]]), "i": None}
    write_json(tmp_path / "deep" / "r.json", value)
    found = read_json(tmp_path / "deep" / "r.json")
    assert found == {"a": 0.5, "b": [0, 1, 2], "c": None, "d": [None, None], "e": True,
                     "f": {"offset_s": 1.0, "path": "x/y"}, "7": [1, 2], "g": ["β"], "h": [[1.0, None]], "i": None}
    assert [p.name for p in (tmp_path / "deep").iterdir()] == ["r.json"]


def test_floats_keep_every_digit(tmp_path):
    numbers = np.random.default_rng(0).normal(size=200) * 10.0 ** np.arange(-100, 100)
    write_json(tmp_path / "n.json", {"n": numbers})
    assert read_json(tmp_path / "n.json")["n"] == numbers.tolist()


def test_what_has_no_place_in_json_is_named():
    with pytest.raises(TypeError, match=r"builtins\.complex"):
        to_json({"z": 1j})


@dataclass(frozen=True, repr=False)
class Verdict(Result):
    passed: bool = field(metadata=named("pass"))
    counts: dict[int, int]
    path_m: np.ndarray
    reading: Reading | None
    delay_s: float = 0.0
    why: str = field(default="", metadata=OPTIONAL)
    clock: tuple[float, float] | None = field(default=None, metadata=OPTIONAL)
    shares: Mapping[str, float] = field(default_factory=dict, metadata=INLINE)


def test_a_result_goes_through_json_and_comes_back():
    one = Verdict(True, {1: 2}, np.array([[1.0, 2.0]]), Reading(0.5, Path("x")), float("nan"), "why", (0.0, 1.0),
                  {"z": 1.0})
    said = to_json(one)
    assert said == {"pass": True, "counts": {"1": 2}, "path_m": [[1.0, 2.0]],
                    "reading": {"offset_s": 0.5, "path": "x"}, "delay_s": None, "why": "why", "clock": [0.0, 1.0],
                    "z": 1.0}
    again = from_json(Verdict, said)
    assert to_json(again) == said
    assert (again.counts, again.reading, again.clock, again.shares) == (one.counts, one.reading, one.clock, one.shares)
    assert np.isnan(again.delay_s)
    bare = Verdict(False, {}, np.zeros(0), None)
    assert list(to_json(bare)) == ["pass", "counts", "path_m", "reading", "delay_s"]
    assert to_json(from_json(Verdict, to_json(bare))) == to_json(bare)


def test_a_result_is_said_in_a_few_lines():
    long = Verdict(True, dict.fromkeys(range(99), 1), np.zeros((500, 3)), None, 0.123456, "because " * 99)
    assert repr(long) == ("Verdict(passed=True, counts=<99>, path_m=<500x3>, delay_s=0.1235, "
                          "why='because because because because becau...', shares=<0>)")

    @dataclass(frozen=True, repr=False)
    class Wide(Result):
        names: tuple[str, ...]
        a: Verdict

    assert repr(Wide(("n" * 99,) * 2, long)).endswith("a=Verdict(...))")
    wide = make_dataclass("Many", [(f"field_{i}", int) for i in range(99)], bases=(Result,), frozen=True, repr=False)
    assert len(repr(wide(*range(99)))) < 400


def test_a_failing_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "r.json"
    write_json(path, {"a": 1})
    with pytest.raises(TypeError):
        write_json(path, {"a": object()})
    assert read_json(path) == {"a": 1}
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_json(tmp_path / "file" / "r.json", {})


@pytest.mark.parametrize(("content", "says"), [
    (None, "cannot be read"), (b"", "line 1: is not JSON"), (b'{"a": 1,\n "b"}', "line 2: is not JSON"),
    (b"[1]", "holds no JSON object"), (b'{"a": "\xff"}', "byte 7: is not UTF-8"),
    (b'{"schema": "other"}', "schema is 'other'; 'nanobench-audit/1' is needed")])
def test_a_broken_file_is_one_line_that_names_it(tmp_path, content, says):
    path = tmp_path / "r.json"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=says) as caught:
        read_json(path, "audit")
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_sweep_takes_only_what_nobody_writes_any_more(tmp_path):
    own, dead = tmp_path / f".r.json.{os.getpid()}.part", tmp_path / ".r.json.4194305.part"
    for path in (own, dead, tmp_path / ".odd.part", tmp_path / "r.json"):
        path.touch()
    sweep(tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([own.name, "r.json"])


def test_envelope_holds_what_every_file_holds():
    content = envelope("audit", {"flights": []}, np.bool_(False), {"seed": 1}, [])
    assert list(content) == ["schema", "version", "synthetic", "manifest", "failed", "flights"]
    assert (content["schema"], content["version"], content["synthetic"]) == ("nanobench-audit/1", __version__, False)


def test_manifest_names_versions_inputs_and_no_folder_of_this_machine(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    inputs = [("/somewhere/else/b.csv", "22"), (str(tmp_path / "data" / "a.csv"), "11")]
    content = manifest(inputs, seed=3, argv=["audit", "--data", "/somewhere/else", "--out", str(tmp_path / "o")])
    assert content["inputs"] == [{"file": "b.csv", "sha256": "22"}, {"file": "data/a.csv", "sha256": "11"}]
    assert content["argv"] == ["nanobench", "audit", "--data", "else", "--out", "o"]
    assert content["versions"]["numpy"] == np.__version__
    assert content["seed"] == 3
    assert content["elapsed_s"] >= 0
    assert "/somewhere" not in json.dumps(content)
    assert portable("--jobs") == "--jobs"


def test_bytes_that_are_not_utf_8_do_not_stop_a_result(tmp_path):
    name = os.fsdecode(b"a\xff.csv")
    write_json(tmp_path / "r.json", {name: [name, Path(name)]})
    assert read_json(tmp_path / "r.json") == {"a\ufffd.csv": ["a\ufffd.csv", "a\ufffd.csv"]}

"""Keys: equal for equal work, different for anything a result could depend on."""

import functools
import importlib
import sys
from dataclasses import replace

import numpy as np
import pytest
from harness_work import score
from hypothesis import given, settings
from hypothesis import strategies as st

from nanobench_tools import Flight, Provenance, make_stream
from nanobench_tools.harness import identity
from nanobench_tools.harness.identity import item_key, method_identity


def flight(px=(0.0, 1.0)):
    stream = make_stream("mocap", [0.0, 1.0], np.transpose([px]), ["px"])
    return Flight("a", {"mocap": stream}, {}, Provenance("a.csv", "00", "test"))


def test_equal_arguments_give_equal_keys_whatever_their_order():
    first = item_key(score, {"a": 1, "b": {"x": 1.5, "y": [1, 2]}, "flight": flight()}, ["s"])
    assert first == item_key(score, {"flight": flight(), "b": {"y": (1, 2), "x": 1.5}, "a": 1}, ["s"])
    assert len(first) == 64


def test_anything_different_gives_another_key():
    changed = replace(flight(), metadata={"family": "oval"})
    cases = [{}, {"a": 1}, {"a": 2}, {"a": 1.0}, {"a": True}, {"a": "1"}, {"a": None}, {"b": 1}, {"a": [1]},
             {"a": b"1"}, {"a": ["ab", "c"]}, {"a": ["a", "bc"]}, {"a": [["a"], "bc"]}, {"a": np.zeros(4)},
             {"a": np.zeros((2, 2))},
             {"a": np.zeros(4, np.float32)}, {"a": flight()}, {"a": flight((0.0, 1.0 + 1e-15))}, {"a": changed},
             {"a": {1, 2}}, {"a": {1, 3}}, {"a": functools.partial(score, 1)}, {"a": functools.partial(score, 2)}]
    keys = [item_key(score, case) for case in cases]
    keys += [item_key(item_key, {}), item_key(score, {}, ["s"]), item_key(score, {}, ["t"]),
             item_key(score, {}, ["s", "t"])]
    assert len(set(keys)) == len(keys)


json_like = st.recursive(st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
                         lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=6)


@settings(max_examples=40)
@given(json_like, json_like)
def test_keys_are_equal_exactly_when_the_arguments_are(a, b):
    same = item_key(score, {"a": a}) == item_key(score, {"a": b})
    assert same == (repr_sorted(a) == repr_sorted(b))


def repr_sorted(value) -> str:
    if isinstance(value, dict):
        return "dict" + repr(sorted((repr(k), repr_sorted(v)) for k, v in value.items()))
    return repr([repr_sorted(v) for v in value]) if isinstance(value, list) else repr(value)


@pytest.fixture
def outside(tmp_path, monkeypatch):
    """A method in two files outside the package; gives a function that writes one and loads both afresh."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "gains_of_mine.py").write_text("GAIN = 1.0\n")
    (tmp_path / "method_of_mine.py").write_text(
        "import numpy as np\nclass Mine:\n    name = 'mine'\n    def __init__(self, k=1):\n        self.k = k\n"
        "    def gain(self):\n        from gains_of_mine import GAIN\n        return GAIN\n")

    def load(file=None, text=None):
        if file:
            (tmp_path / file).write_text(text)
        for name in ("gains_of_mine", "method_of_mine"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        identity._source_hash.cache_clear()
        return importlib.import_module("method_of_mine").Mine

    yield load
    for name in ("gains_of_mine", "method_of_mine"):
        sys.modules.pop(name, None)
    identity._source_hash.cache_clear()


def test_a_changed_source_of_an_outside_method_changes_its_identity(outside):
    first = method_identity(outside())
    assert method_identity(outside()) == first
    helper = method_identity(outside("gains_of_mine.py", "GAIN = 1.25\n"))
    assert helper != first
    own = method_identity(outside("method_of_mine.py", "import gains_of_mine\nclass Mine:\n    name = 'mine'\n"))
    assert len({first, helper, own}) == 3


def test_attributes_and_version_of_a_method_count(outside):
    mine = outside()
    assert method_identity(mine(1)) == method_identity(mine(1))
    assert method_identity(mine(1)) != method_identity(mine(2))
    before = method_identity(mine(1))
    mine.version = "2"
    assert method_identity(mine(1)) != before


def test_every_file_of_an_outside_package_counts(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    package = tmp_path / "package_of_mine"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "method.py").write_text("class Mine:\n    name = 'mine'\n")
    (package / "part.py").write_text("A = 1\n")
    (package / "weights.bin").write_bytes(b"1")
    mine = importlib.import_module("package_of_mine.method").Mine
    found = {method_identity(mine)}
    for name, content in (("part.py", b"A = 2\n"), ("weights.bin", b"12")):
        (package / name).write_bytes(content)
        identity._source_hash.cache_clear()
        found.add(method_identity(mine))
    assert len(found) == 3


def test_a_method_without_a_file_is_never_the_same():
    namespace = {"__name__": "no_such_module"}
    exec("class Typed:\n    pass", namespace)
    assert method_identity(namespace["Typed"])
    identity._source_hash.cache_clear()
    first = method_identity(namespace["Typed"])
    identity._source_hash.cache_clear()
    assert method_identity(namespace["Typed"]) != first


def test_own_sources_are_part_of_every_key(tmp_path, monkeypatch):
    package = tmp_path / "nanobench_tools" / "harness"
    package.mkdir(parents=True)
    (package / "identity.py").write_text("x = 1\n")
    monkeypatch.setattr(identity, "__file__", str(package / "identity.py"))
    identity.package_hash.cache_clear()
    first = item_key(score, {})
    (package / "data.toml").write_text("a = 1\n")
    identity.package_hash.cache_clear()
    assert item_key(score, {}) != first
    identity.package_hash.cache_clear()

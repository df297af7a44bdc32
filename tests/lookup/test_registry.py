"""Names of methods: known, unknown, from outside, broken."""

import pytest

from nanobench_tools import UsageError
from nanobench_tools.lookup import registry


def test_anything_importable_is_found_by_module_and_class():
    assert registry.load("estimators", "collections:OrderedDict").__name__ == "OrderedDict"


@pytest.mark.parametrize(("name", "words"), [
    ("no_such_method", "known:"),
    ("no_such_module:Thing", "No module named"),
    ("collections:NoSuchClass", "NoSuchClass"),
])
def test_an_unknown_name_is_a_usage_error_of_one_line(name, words):
    with pytest.raises(UsageError, match=words) as caught:
        registry.load("estimators", name)
    assert "\n" not in str(caught.value)


def test_a_module_that_fails_while_imported_is_named(tmp_path, monkeypatch):
    (tmp_path / "broken_module_for_test.py").write_text("1 / 0\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match="broken_module_for_test:X: importing it raised ZeroDivisionError"):
        registry.load("estimators", "broken_module_for_test:X")


def test_an_unknown_group_is_a_programming_error():
    with pytest.raises(KeyError, match="no registry group"):
        registry.names("sorcerers")

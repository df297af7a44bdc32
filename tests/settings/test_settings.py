"""Settings: each entry is complete, and one module uses it once."""

import ast
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from nanobench_tools.errors import InputError
from nanobench_tools.settings import count, everything, models, number, recordings, setting

CALL = re.compile(r'\b(?:number|count|setting)\(\s*"([a-z0-9_]+\.[a-z0-9_]+\.[a-z0-9_]+)"')
GETTERS = ("number", "count", "setting")
ROOT = Path(__file__).parents[2]
PACKAGES = ("nanobench_tools", "estimators", "controllers", "identification")


@pytest.fixture(scope="module")
def texts():
    """Path below the root -> text of every module."""
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
            for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))}


def test_every_setting_is_whole_and_names_what_it_was_set_on():
    found = everything()
    assert found
    for key, entry in found.items():
        assert len(key.split(".")) == 3, key
        assert entry.does.strip(), key
        assert entry.unit.strip(), key
        assert entry.set_on in recordings(), f"{key}: {entry.set_on} is not in recordings.toml"
    for model in models():
        assert (ROOT / model.file).is_file(), model.file
        assert model.set_on in recordings()


def test_recordings_say_kind_and_number_and_are_used():
    used = {entry.set_on for entry in everything().values()} | {model.set_on for model in models()}
    for entry in recordings().values():
        assert entry.kind in ("real", "SYNTHETIC", "both", "unknown"), entry.name
        assert entry.what, entry.name
        assert "/" not in entry.what, f"{entry.name}: no paths"
        assert entry.name in used, f"{entry.name} sets nothing"
        if entry.n == "" and entry.name != "not_recorded":
            assert "not recorded" in entry.what or entry.name == "published", f"{entry.name}: how many?"


def test_every_setting_is_asked_for_once(texts):
    asked = Counter(key for module, text in texts.items() if not module.startswith("nanobench_tools/settings/")
                    for key in CALL.findall(text))
    assert sorted(asked) == sorted(everything())
    assert {key: n for key, n in asked.items() if n > 1} == {}


def test_a_key_has_the_name_of_its_module_and_constant(texts):
    for module, text in texts.items():
        if module.startswith("nanobench_tools/settings/"):
            continue
        names = [part for part in module.removesuffix(".py").split("/") if part != "__init__"]
        for key in CALL.findall(text):
            assert key.split(".")[1] == names[-1], f"{module}: {key}"


def test_compiled_functions_take_settings_as_arguments(texts):
    """Numba keeps machine code by the date of the .py file: a changed TOML file would not be seen."""
    settings: dict[str, set[str]] = {}
    for module, text in texts.items():
        for node in ast.parse(text).body if any(f"{getter}(" in text for getter in GETTERS) else ():
            if isinstance(node, (ast.Assign, ast.AnnAssign)) and node.value is not None and any(
                    isinstance(n, ast.Call) and isinstance(n.func, ast.Name) and n.func.id in GETTERS
                    for n in ast.walk(node.value)):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                settings.setdefault(module, set()).update(
                    n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name))
    for module, text in texts.items():
        if "jit" not in text:
            continue
        tree = ast.parse(text)
        mine = settings.get(module, set()) | {
            alias.asname or alias.name for node in tree.body if isinstance(node, ast.ImportFrom)
            for alias in node.names for source, names in settings.items()
            if alias.name in names and source.endswith(f"/{(node.module or '').rpartition('.')[2]}.py")}
        for function in ast.walk(tree):
            if isinstance(function, ast.FunctionDef) and any("jit" in ast.unparse(d) for d in function.decorator_list):
                inside = {n.id for n in ast.walk(function) if isinstance(n, ast.Name)}
                given = {a.arg for a in function.args.args}
                assert not (inside & mine) - given, f"{module}: {function.name} has {inside & mine} compiled into it"


def test_values_come_as_numbers_tuples_and_dictionaries_of_ones_own():
    key, value = next((k, s.value) for k, s in everything().items() if isinstance(s.value, dict))
    mine = setting(key)
    assert mine == value
    mine.clear()
    assert setting(key) == value
    for key, entry in everything().items():
        assert "[" not in repr(entry.value), key
        if type(entry.value) is float:
            assert number(key) == entry.value
            with pytest.raises(TypeError, match=key):
                count(key)


def test_unknown_keys_and_areas_are_refused_in_one_line():
    for key in ("audit.no.such", "nowhere.at.all", "audit"):
        with pytest.raises(InputError) as caught:
            setting(key)
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="audit"):
        setting("nowhere.at.all")


def test_asking_settings_reads_no_other_area():
    code = ("import nanobench_tools.settings as s; s.setting('audit.crashes.lasts_s'); "
            "print(s.of_area.cache_info().currsize)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "1"

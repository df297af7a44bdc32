"""Settings: entries are whole, every one is used once, and numbers of that kind stand nowhere else."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import Counter

import pytest

from nanobench_tools.errors import InputError
from nanobench_tools.settings import count, everything, literals, models, number, recordings, setting

CALL = re.compile(r'\b(?:number|count|setting)\(\s*"([a-z0-9_]+\.[a-z0-9_]+\.[a-z0-9_]+)"')
GETTERS = ("number", "count", "setting")


@pytest.fixture(scope="module")
def texts():
    return dict(literals.sources())


def test_every_setting_is_whole_and_names_what_it_was_set_on():
    found = everything()
    assert found
    for key, entry in found.items():
        assert len(key.split(".")) == 3, key
        assert entry.does.strip(), key
        assert entry.unit.strip(), key
        assert entry.set_on in recordings(), f"{key}: {entry.set_on} is not in recordings.toml"
    for model in models():
        assert (literals.ROOT / model.file).is_file(), model.file
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


def test_no_number_is_of_unknown_origin():
    """A new number: put it into ``values/AREA.toml`` if it was set by looking at data; else say in ``origins.toml``
    what it is."""
    assert list(map(str, literals.unexplained())) == []


def test_origins_are_declared_of_what_exists():
    everywhere = [literal for module, text in literals.sources() for literal in literals.literals(module, text)]
    for origin in literals.origins():
        assert origin.kind in literals.KINDS, origin
        assert origin.why, origin
    stale = [o.where for o in literals.origins() if not any(o.covers(literal) for literal in everywhere)]
    assert stale == [], "no number there to explain"


def test_compiled_functions_take_settings_as_arguments(texts):
    """Numba keeps machine code by the date of the .py file: a changed TOML file would not be seen."""
    settings: dict[str, set[str]] = {}
    for module, text in texts.items():
        for node in ast.parse(text).body:
            if isinstance(node, (ast.Assign, ast.AnnAssign)) and node.value is not None and any(
                    isinstance(n, ast.Call) and ast.unparse(n.func) in GETTERS for n in ast.walk(node.value)):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                settings.setdefault(module, set()).update(
                    n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name))
    for module, text in texts.items():
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


@pytest.mark.parametrize(("text", "expected"), [
    ("LIMIT = 0.3", [("LIMIT", 0.3)]),
    ("LIMIT_S, REACH_M = 0.3, 4", [("LIMIT_S", 0.3), ("REACH_M", 4)]),
    ("ONE, TWO, HALVED = 1, 2, 1 / 2", []),
    ("HOLD_S = 1.0", [("HOLD_S", 1.0)]),
    ("SMALL = 1e-12", []),
    ("def f(x): return max(x, 1e-6) + 9.81", []),
    ("class A:\n    share: float = 0.7\n    n: int = 1", [("A.share", 0.7)]),
    ("def f(x, tolerance=0.02): return x", [("f", 0.02)]),
    ("def f(x, *, tolerance=0.02): return x", [("f", 0.02)]),
    ("def f(x): return x[3:7] * 0.5 + 4 * x ** 3", []),
    ("def f(x): return x > 3", [("f", 3)]),
    ("def f(x): return x[0] > 0", []),
    ("def f(x): return max(x, 5.0)", [("f", 5.0)]),
    ("def f(x): return 0.37 * x", [("f", 0.37)]),
    ("def f(x): return 1000.0 * x + 1e-6", []),
    ("def f(x): return 0.1 * x", [("f", 0.1)]),
    ("def f(x):\n    LOCAL = 6\n    return LOCAL", [("f.LOCAL", 6)]),
    ("class K(IntEnum):\n    A = 7", []),
    ("TABLE = {'a': (0.1, 3), 'b': -1.5}", [("TABLE", 0.1), ("TABLE", 3), ("TABLE", 1.5)]),
    ("X = number('audit.x.y')", []),
    ("FLAG = True", []),
    ("TRIED = np.array([0.1, 7.0]), range(7), np.zeros((3, 4))", [("TRIED", 0.1), ("TRIED", 7.0)]),
    ("def f(x): return g(x, 3) > h(x)", []),
])
def test_which_numbers_need_an_origin(text, expected):
    assert [(found.scope, found.value) for found in literals.literals("m.py", text)] == expected


def test_an_origin_covers_its_place_only():
    here = literals.Literal("a/b/c.py", "Part.share", 1, 0.3)
    covering = ["a/", "a/b/", "a/b/c.py", "a/b/c.py:Part", "a/b/c.py:Part.share"]
    other = ["a/b", "b/", "a/b/c.py:Par", "a/b/c.py:share", "a/b/d.py", "a/b/d.py:Part"]
    assert all(literals.Origin(where, "shown", "x").covers(here) for where in covering)
    assert not any(literals.Origin(where, "shown", "x").covers(here) for where in other)


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

"""Every message about a missing package names the extra that brings it."""

import ast
import configparser
import re
import sys
from pathlib import Path

import pytest

from nanobench_tools.cli.main import main
from nanobench_tools.errors import MissingExtraError, how_to_install

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("nanobench_tools", "estimators", "controllers", "identification", "benchmarks", "tools")


def extras():
    """{extra: the packages it brings}."""
    config = configparser.ConfigParser()
    config.read(ROOT / "setup.cfg")
    return {extra: {re.split(r"[<>=~!\s]", line)[0] for line in text.split("\n") if line}
            for extra, text in config["options.extras_require"].items()}


def calls(name):
    """(file and line, arguments that are plain text) of every call of ``name``."""
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            text = path.read_text()
            for node in ast.walk(ast.parse(text)) if f"{name}(" in text else ():
                if isinstance(node, ast.Call) and getattr(node.func, "id", "") == name:
                    yield f"{path.relative_to(ROOT)}:{node.lineno}", [
                        a.value if isinstance(a, ast.Constant) else None for a in node.args]


def test_every_extra_that_a_message_names_brings_the_package():
    known, seen = extras(), 0
    for place, (package, extra) in calls("MissingExtraError"):
        assert extra in known, place
        assert package is None or package in known[extra], (place, package, extra)
        seen += package is not None
    assert seen > 10
    for place, (extra,) in calls("how_to_install"):
        assert extra is None or extra in known, place


def test_no_message_spells_the_command_itself():
    for folder in FOLDERS[:4]:
        for path in (ROOT / folder).rglob("*.py"):
            if path.name != "errors.py":
                assert "pip install" not in path.read_text(), path


@pytest.mark.parametrize(("package", "extra", "arguments"), [
    ("casadi", "identification", ["motors", "x.csv"]), ("casadi", "identification", ["prove"]),
    ("casadi", "identification", ["diagnose", "--simulator", "x.toml"]),
    ("rotorpy", "rotorpy", ["prove", "--engine", "rotorpy"])])
def test_without_the_package_a_verb_says_which_extra(monkeypatch, capsys, package, extra, arguments):
    monkeypatch.setitem(sys.modules, package, None)
    assert main(arguments) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert f"{package} is not installed; {how_to_install(extra)}" in err


def test_the_message_has_the_words():
    assert str(MissingExtraError("osqp", "mpc")) == f"osqp is not installed; {how_to_install('mpc')}"

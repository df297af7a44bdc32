"""What CONTRIBUTING.md tells somebody to run and to open exists; hooks, templates and fields of the project agree."""

import configparser
import importlib
import re
import shlex
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

from nanobench_tools.cli.main import VERBS
from nanobench_tools.lookup import registry
from nanobench_tools.physics.export import TARGETS

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
BLOCKS = re.findall(r"```sh\n(.*?)```", TEXT, re.DOTALL)
COMMANDS = [line.split("#")[0].strip() for block in BLOCKS for line in block.splitlines() if line.strip()]
NAMED = [*COMMANDS, *(words for words in re.findall(r"`([^`\n]+)`", TEXT) if words.startswith(("make ", "nanobench ")))]
SETUP = configparser.ConfigParser()
SETUP.read(ROOT / "setup.cfg", encoding="utf-8")
GOALS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
ELSEWHERE = ("build/fresh/", "python3")
"""A command that the release's own steps make."""


@pytest.mark.parametrize("command", NAMED)
def test_a_command_exists_with_its_options(command):
    program, *words = shlex.split(command)
    if program == "make":
        assert words[0] in GOALS
    elif program == "nanobench":
        verb, *options = words
        assert verb in VERBS
        parameters = getattr(importlib.import_module(f"nanobench_tools.cli.{verb}"), verb).params
        known = {option for parameter in parameters for option in parameter.opts}
        assert {o for o in options if o.startswith("--")} <= known
    elif program.startswith(".venv/bin/python"):
        assert words[0] == "-m"
        module = ROOT / words[1].replace(".", "/")
        ours = (module / "__main__.py", module.with_suffix(".py"))
        assert words[1] in ("pip", "pytest") or any(file.is_file() for file in ours)
        for place in (word for word in words if word.startswith("tests/")):
            assert (ROOT / place).exists(), place
    elif program.startswith(".venv/bin/"):
        assert Path(program).name in {"pre-commit"}
    elif program == ".ci/run":
        assert (ROOT / program).is_file()
    else:
        assert program.startswith(ELSEWHERE), program


def test_there_are_commands_of_every_sort():
    assert {shlex.split(c)[0] for c in NAMED} >= {"make", "nanobench", ".venv/bin/python"}
    assert len(COMMANDS) > 12


def test_options_of_tools_exist(capsys):
    from tools.figures.__main__ import main

    with pytest.raises(SystemExit):
        main(["--help"])
    said = capsys.readouterr().out
    for option in re.findall(r"tools\.figures (--\w+)", TEXT):
        assert option in said


def test_every_file_and_folder_it_names_is_there():
    inside = re.sub(r"```.*?```", "", TEXT, flags=re.DOTALL)
    path = re.compile(r"(?!\.)[\w.]+/[\w/.]+$|\w+\.(?:cfg|cff|md|toml)$")
    named = {*re.findall(r"\]\(([^)#]+)\)", inside), *filter(path.match, re.findall(r"`([^`\s]+)`", inside))}
    gone = [name for name in named if not (ROOT / name.replace("NAME.py", "").replace("NAME.toml", "")).exists()]
    assert len(named) > 20
    assert not gone, gone


def test_it_says_how_to_add_one_of_every_registered_group():
    """``simulators`` are adapters of ours beside the exports; a user gives a callable."""
    said = set(re.findall(r"`nanobench\.(\w+)`", TEXT))
    assert said == set(registry.GROUPS) - {"simulators"}
    assert all(f"nanobench.{group}" in SETUP["options.entry_points"] for group in said)
    assert TARGETS


def test_the_attributes_it_asks_of_methods_are_those_of_the_protocols():
    from nanobench_tools.steps.named_methods import KINDS

    rows = {row.split("|")[1].strip(): row for row in TEXT.splitlines() if row.startswith("| ")}
    for group, (_, attributes) in KINDS.items():
        assert all(f"`{attribute}`" in rows[group.removesuffix("s")] for attribute in attributes), group


def test_hooks_are_the_linters_of_make_lint():
    body = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text("utf-8"))
    hooks = {hook["id"]: hook for repo in body["repos"] for hook in repo["hooks"]}
    recipe = (ROOT / "Makefile").read_text("utf-8").partition("\nlint:")[2].partition("\n\n")[0]
    assert set(hooks) == {"ruff", "mypy"}
    for hook in hooks.values():
        program, *_ = hook["entry"].split()
        assert Path(program).name in recipe
        assert (Path(sys.executable).parent / Path(program).name).exists()


def test_authors_agree_and_templates_are_read_by_the_forge():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert SETUP["metadata"]["author"] == citation["authors"][0]["name"]
    assert SETUP["metadata"]["name"] in citation["message"] + citation["title"] + str(citation.get("abstract", ""))
    assert SETUP["metadata"]["license"] == citation["license"]
    for template in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.md"):
        head = yaml.safe_load(template.read_text("utf-8").split("---\n")[1])
        assert set(head) == {"name", "about", "labels"}
    assert (ROOT / ".github" / "pull_request_template.md").is_file()
    assert tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["build-system"]["build-backend"]

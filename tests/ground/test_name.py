"""The name of the distribution, in every message and every line that says how to install it."""

import configparser
import re
import subprocess
from pathlib import Path

import pytest

from nanobench_tools.errors import DISTRIBUTION, MissingExtraError, how_to_install

ROOT = Path(__file__).parents[2]
EXTRAS = configparser.ConfigParser()
EXTRAS.read(ROOT / "setup.cfg", encoding="utf-8")
ANOTHERS = re.compile(r"pip3? install\b[^\n]*[\s\"']nanobench(?![-\w/.])|\bnanobench\\*\[[a-z]")
"""Installs the package of the index that is called ``nanobench``, or extras of it."""


def kept_files() -> list[Path]:
    try:
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("NO GIT CHECKOUT: which files belong to the project is asked of git")
    return [ROOT / name for name in listed.split("\0") if name and (ROOT / name).is_file()]


@pytest.mark.parametrize("line", ["pip install nanobench", "pip install -U nanobench", "pip install 'nanobench[mpc]'",
                                  'pip install "nanobench"', "needs nanobench[mocap]", r"nanobench\[mpc\]"])
def test_the_search_finds_what_it_is_for(line):
    assert ANOTHERS.search(line)


@pytest.mark.parametrize("line", ["pip install nanobench-tools", 'pip install "nanobench-tools[mpc]"', "nanobench run",
                                  "pip install -e .[report], then nanobench_tools"])
def test_the_search_leaves_alone_what_is_right(line):
    assert not ANOTHERS.search(line)


def test_nothing_tells_a_user_to_install_somebody_elses_package():
    found = [f"{path.relative_to(ROOT)}:{i}: {line.strip()}" for path in kept_files() if path != Path(__file__)
             for i, line in enumerate(path.read_text("utf-8", errors="replace").splitlines(), 1)
             if ANOTHERS.search(line)]
    assert not found, "\n".join(found)


def test_the_distribution_has_the_name_that_messages_say():
    assert EXTRAS["metadata"]["name"] == DISTRIBUTION == "nanobench-tools"
    assert "nanobench = nanobench_tools.cli.main:main" in EXTRAS["options.entry_points"]["console_scripts"]


def test_every_extra_that_a_message_or_page_names_exists():
    known = set(EXTRAS["options.extras_require"])
    named = re.compile(rf"(?:{DISTRIBUTION}|-e \"\.)\[([a-z,]+)\]|how_to_install\([\"'](\w+)[\"']\)"
                       r"|MissingExtraError\([^)]*?, [\"'](\w+)[\"']\)")
    asked = {extra for path in kept_files() if path.suffix in (".py", ".md", ".html")
             for match in named.finditer(path.read_text("utf-8"))
             for extra in next(filter(None, match.groups())).split(",")}
    assert len(asked) > 8
    assert asked <= known, asked - known


def test_a_checkout_is_installed_by_its_path_and_an_inactive_environment_by_its_python(monkeypatch, tmp_path):
    monkeypatch.setattr("sys.prefix", str(tmp_path / "venv"))
    monkeypatch.setattr("sys.executable", str(tmp_path / "venv/bin/python"))
    monkeypatch.setenv("VIRTUAL_ENV", str(tmp_path / "venv"))
    monkeypatch.chdir(ROOT)
    assert str(MissingExtraError("gtsam", "smoothers")) == 'gtsam is not installed; pip install -e ".[smoothers]"'
    monkeypatch.delenv("VIRTUAL_ENV")
    monkeypatch.chdir(tmp_path)
    assert how_to_install("mpc") == f'venv/bin/python -m pip install -e "{ROOT}[mpc]"'


def test_without_a_checkout_the_distribution_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr("nanobench_tools.errors.__file__", str(tmp_path / "site-packages/nanobench_tools/errors.py"))
    assert how_to_install("smoothers") == 'pip install "nanobench-tools[smoothers]"'

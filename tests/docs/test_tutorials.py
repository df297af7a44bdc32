"""Tutorials and gallery: each script runs, and its page has the code and the output of the script."""

import math
import re

import pytest

from tools import tutorials

SLOW = {"simulator_check", "vehicle_and_thrust", "own_controller", "mpc", "dead_log", "thrust_stand", "first_log",
        "compare_estimators", "no_drag", "function_simulator", "blackout", "exports", "own_units", "trajectory_files",
        "linear_model", "euroc", "own_estimator", "cut_propeller", "believed_wind"}
"""More than two seconds."""
NUMBER = re.compile(r"-?\d+\.?\d*(?:e-?\d+)?")
TOLERANCE = 0.05
"""Of printed numbers: solvers differ a little between machines."""


def blocks(page: str, kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)\n```", page, re.S | re.M)


def same(one: str, other: str) -> bool:
    """Whether two outputs agree in their words, and in their numbers within the tolerance."""
    def words(text):
        return NUMBER.sub("#", text).split()

    def numbers(text):
        return [float(n) for n in NUMBER.findall(text)]

    return words(one) == words(other) and all(
        math.isclose(a, b, rel_tol=TOLERANCE, abs_tol=2e-3) for a, b in zip(numbers(one), numbers(other), strict=True))


def page_of(name):
    return tutorials.SCRIPTS[name].with_suffix(".md").read_text("utf-8")


def test_there_are_five_tutorials_and_a_gallery():
    folders = [path.parent.name for path in tutorials.SCRIPTS.values()]
    assert folders.count("tutorials") == 5
    assert folders.count("gallery") >= 6
    assert set(tutorials.SCRIPTS) >= SLOW


@pytest.mark.parametrize("name", tutorials.SCRIPTS)
def test_a_page_has_the_code_of_its_script(name):
    code = [tutorials.ALT.sub("", cell.body) for cell in tutorials.cells(tutorials.SCRIPTS[name].read_text("utf-8"))
            if not cell.is_text]
    assert blocks(page_of(name), "python") == code


@pytest.mark.parametrize("name", tutorials.SCRIPTS)
def test_pictures_are_small_in_light_and_dark_with_a_text(name):
    found = re.findall(r"!\[([^\]]*)\]\((pictures/[\w-]+)-(light|dark)\.svg#only-\3\)", page_of(name))
    assert found
    assert {shade for _, _, shade in found} == {"light", "dark"}
    for text, stem, shade in found:
        assert len(text) > 20
        size = (tutorials.SCRIPTS[name].parent / f"{stem}-{shade}.svg").stat().st_size
        assert size < tutorials.LARGEST_PICTURE


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n
                                  for n in tutorials.SCRIPTS])
def test_a_script_prints_what_its_page_shows(name):
    printed = [given.printed for _, given in tutorials.run(name) if given is not None and given.printed]
    shown = blocks(page_of(name), "text")
    assert len(printed) == len(shown)
    for now, then in zip(printed, shown, strict=True):
        assert same(now, then), f"{now}\n--- the page has\n{then}\n--- python -m tools.tutorials {name}"


def test_the_first_page_of_the_gallery_is_up_to_date():
    assert (tutorials.DOCS / "gallery/index.md").read_text("utf-8") == tutorials.gallery()


def test_outputs_are_compared_by_words_and_numbers():
    assert same("error 1.00 mm", "error 1.02 mm")
    assert not same("error 1.00 mm", "error 1.20 mm")
    assert not same("error 1.00 mm", "errors 1.00 mm")

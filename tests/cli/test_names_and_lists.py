"""One vocabulary of options and names over the verbs, what each takes, and what is meant by a name that is nearly one.
"""

import importlib

import pytest

from identification.prove.plan import QUOTAS
from nanobench_tools.cli import listing
from nanobench_tools.cli.control import PLANTS
from nanobench_tools.cli.convert import ALL, FORMATS, SIMULATORS
from nanobench_tools.cli.main import LISTED, VERBS
from nanobench_tools.lookup import deprecation
from nanobench_tools.lookup.registry import names
from nanobench_tools.practice.references import FAMILIES
from nanobench_tools.protocols import task2, task3

ONE_WORD = {"--family": "--trajectory", "--figure": "--trajectory", "--duration": "--seconds",
            "--duration-s": "--seconds", "--methods": "--method", "--protocols": "--protocol",
            "--controllers": "--controller", "--trajectories": "--trajectory"}
"""Spellings that no verb may have beside the one word."""


def spelled(verb):
    command = getattr(importlib.import_module(f"nanobench_tools.cli.{verb}"), verb)
    return {option for parameter in command.params for option in parameter.opts}


def test_every_verb_uses_the_one_word():
    for verb in VERBS:
        assert not spelled(verb) & set(ONE_WORD), verb


def test_a_former_name_works_and_its_warning_names_the_new_one():
    with pytest.warns(FutureWarning, match="--trajectory figure8 is called --trajectory figure_eight now"):
        assert deprecation.todays_options("control", ["control", "--trajectory", "figure8", "--seed", "1"]) == [
            "control", "--trajectory", "figure_eight", "--seed", "1"]
    with pytest.warns(FutureWarning, match="--family figure8 is called --trajectory figure_eight now"):
        assert deprecation.todays_options("simulate", ["simulate", "--family=figure8", "x"]) == [
            "simulate", "--trajectory=figure_eight", "x"]
    with pytest.warns(FutureWarning, match="--methods learned is called --learned all now"):
        assert deprecation.todays_options("sysid", ["sysid", "--methods", "learned"]) == ["sysid", "--learned", "all"]
    with pytest.warns(FutureWarning) as said:
        assert deprecation.todays_options("fly", ["fly", "--controller", "pid"]) == [
            "fly", "--controller", "onboard_pid"]
    assert len(said) == 1


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("words", [["control", "--trajectory"], ["control", "--controller", "--", "pid"],
                                   ["control", "--out", "pid"], ["simulate", "--trajectory", "oval"]])
def test_what_is_no_former_name_is_left_alone(words):
    assert deprecation.todays_options(words[0], words) == words


def test_former_names_are_no_names_of_today_and_those_of_today_exist():
    known = {"--trajectory": FAMILIES, "--judge": FAMILIES, "--controller": names("controllers"),
             "--learned": ("all", "own")}
    for option, former in deprecation.FORMER_NAMES.items():
        assert not set(former) & set(known[option])
        assert set(former.values()) <= set(known[option])


@pytest.mark.parametrize(("arguments", "says"), [
    (["estimate", "--protocol", "balckout"], "unknown protocol 'balckout'; did you mean 'blackout'? known: as-pub"),
    (["estimate", "--protocol", "whole_flight"], "did you mean 'whole-flight'?"),
    (["estimate", "--method", "drag-ekf"], "unknown estimator 'drag-ekf'; did you mean 'drag_ekf'? known:"),
    (["sysid", "--method", "naiv"], "unknown predictor 'naiv'; did you mean 'naive'?"),
    (["control", "--plant", "simulate"], "unknown plant 'simulate'; did you mean 'simulated'?"),
    (["control", "--plant", "simulated", "--controller", "geometrc"], "did you mean 'geometric'?"),
    (["control", "--plant", "simulated", "--trajectory", "figure-eight"], "did you mean 'figure_eight'?"),
    (["fly", "--controller", "onboard_pid", "--trajectory", "cirlce", "--dry-run"], "did you mean 'circle'?"),
    (["tune", "--controller", "geometric", "--trajectory", "cirlce"], "did you mean 'circle'?"),
    (["simulate", "--out", "x", "--trajectory", "cirlce"], "did you mean 'circle'?"),
    (["simulate", "--out", "x", "--controller", "onbord_pid"], "did you mean 'onboard_pid'?"),
    (["prove", "--kind", "singel"], "unknown kind 'singel'; did you mean 'single'?")])
def test_a_name_that_is_nearly_one_is_offered(nanobench, arguments, says):
    code, out, err = nanobench(*arguments)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert says in err


def test_lists_hold_what_the_verbs_take():
    assert set(LISTED) == set(listing.LISTS)
    assert set(listing.TASK3) == set(task3.KNOWN)
    assert set(listing.TASK2) == set(task2.PROTOCOLS)
    assert set(listing.PLANTS) == set(PLANTS)
    assert set(listing.KINDS) == set(QUOTAS)
    assert set(listing.TARGETS) == {*FORMATS, *SIMULATORS, ALL}


@pytest.mark.parametrize("verb", LISTED)
def test_a_list_has_a_line_with_a_sentence_for_every_name(nanobench, verb):
    code, out, err = nanobench(verb, "--list", "--verbose")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    titles = [line for line in lines if " " not in line]
    assert titles == list(listing.LISTS[verb])
    said = [line.split(maxsplit=1) for line in lines if line not in titles]
    names = {name for group in listing.LISTS[verb].values() for name in group()}
    assert {name for name, _ in said} >= names
    assert all(sentence.endswith((".", '"')) and len(sentence) > 10 for _, sentence in said)
    screen = nanobench(verb, "--list")[1]
    assert len(screen.splitlines()) < 24
    assert names <= set(screen.replace(",", " ").split())
    assert all(line == line.rstrip() for line in lines)
    assert "--list" in nanobench(verb, "--help")[1]


def test_a_plug_in_stands_in_the_list_and_one_that_fails_says_why(monkeypatch):
    class Kept:
        """Keeps still. And more."""

    def load(group, name):
        if name == "broken":
            raise ImportError("no module named nothing")
        return Kept

    monkeypatch.setattr("nanobench_tools.lookup.registry.names", lambda group: ["broken", "kept"])
    monkeypatch.setattr("nanobench_tools.lookup.registry.load", load)
    assert listing.registered("estimators") == {
        "broken": "cannot be loaded: ImportError: no module named nothing", "kept": "Keeps still."}

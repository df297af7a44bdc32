"""Former names of options and of what is imported: they work, and say the new word."""

import importlib
import warnings

import pytest

from nanobench_tools.auditing.faults.kinds import cutting
from nanobench_tools.cli.main import VERBS, main
from nanobench_tools.lookup import deprecation


def test_a_former_option_works_and_its_warning_names_the_new_one(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(deprecation.FORMER_OPTIONS, "audit", {"--recordings": "--data"})
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    said = []
    for option in ("--recordings", "--data"):
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            assert main(["audit", option, str(tmp_path / "nothing")]) == 2
        said.append(capsys.readouterr().err.splitlines())
    warning = "nanobench: warning: --recordings is called --data now; the former name goes with the next release"
    assert said[0] == [warning, *said[1]]
    with pytest.warns(FutureWarning, match="--data"):
        assert deprecation.todays_options("audit", ["audit", "--recordings=x", "--json", "-"]) == [
            "audit", "--data=x", "--json", "-"]


def test_other_words_are_left_alone(monkeypatch):
    monkeypatch.setitem(deprecation.FORMER_OPTIONS, "audit", {"--recordings": "--data"})
    words = ["audit", "--recordingsX", "recordings", "--", "--recordings"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert deprecation.todays_options("audit", words) == words
        assert deprecation.todays_options("noise", ["--recordings"]) == ["--recordings"]


def test_a_former_name_gives_what_it_is_today_and_any_other_is_an_error():
    import nanobench_tools.auditing as audit

    with pytest.warns(FutureWarning, match=r"CUTTING_KINDS is called .*\.faults\.kinds\.cutting\(\) now"):
        assert cutting() == audit.CUTTING_KINDS
    look_up = deprecation.renamed("here", {"Old": "collections:OrderedDict"})
    with pytest.warns(FutureWarning, match="here.Old is called collections.OrderedDict now"):
        assert look_up("Old").__name__ == "OrderedDict"
    with pytest.raises(AttributeError, match="'here' has no attribute 'nothing'"):
        look_up("nothing")


def test_a_former_option_is_no_option_of_today():
    """Else one word would mean two things; and every target exists."""
    for verb, former in deprecation.FORMER_OPTIONS.items():
        assert verb in VERBS
        command = getattr(importlib.import_module(f"nanobench_tools.cli.{verb}"), verb)
        spelled = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
        assert not spelled & set(former)
        assert set(former.values()) <= spelled


@pytest.mark.parametrize("place", ["nanobench_tools.auditing:audit", "nanobench_tools.faults.kind:FaultKind",
                                   "nanobench_tools.retiming.apply:retimed"])
def test_former_places_work_for_one_release(place):
    module, _, name = place.partition(":")
    with pytest.warns(FutureWarning, match=rf"{place.replace(':', '.')} is called nanobench_tools\."):
        found = getattr(importlib.import_module(module), name)
    assert found.__name__ == name

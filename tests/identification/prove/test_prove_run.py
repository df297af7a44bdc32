"""A proof from plan to prove.json with a diagnosis that is made up: sealed first, resumed, compared, shown."""

import importlib.util
import json
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import pytest

import nanobench_tools as nb
from identification.mismatch.posterior import posterior_engine
from identification.prove import blind_proof as proof
from identification.prove.plan import plan_cases
from identification.prove.seal import seal
from identification.prove.truth import TrueEffect, TrueFault, Truth
from nanobench_tools.api import proved
from nanobench_tools.cli.main import main
from nanobench_tools.errors import InputError, UsageError, how_to_install
from nanobench_tools.harness import run_items

ASKED: list[str] = []


def silent(flights, simulator, *, seed):
    """A diagnosis that never finds anything."""
    ASKED.append(f"{flights[0]} {seed}")
    return {"outcome": "none", "findings": [], "unknown": None, "data_faults": [], "power": {}, "improvement": None,
            "elapsed_s": 1.0}


def another(flights, simulator, *, seed):
    ASKED.append("another")
    return silent(flights, simulator, seed=seed)


def failing(flights, simulator, *, seed):
    """A diagnosis that cannot take the second case."""
    if flights[0].endswith("001"):
        raise InputError("flight_1", "cannot be used")
    return silent(flights, simulator, seed=seed)


def made(specs):
    """Cases that are never flown."""
    return [SimpleNamespace(name=s.name, spec=s, flights=[f"flight of {s.name}"], simulator=None, truth=told(s))
            for s in specs]


def told(s):
    return Truth(s.name, s.kind, tuple(TrueEffect(h.effect, h.size, (), s.kind == "foreign") for h in s.concealed),
                 tuple(TrueFault("flight_1", f.kind) for f in s.faults), engine=s.engine)


@pytest.fixture(autouse=True)
def not_flown(monkeypatch, tmp_path):
    monkeypatch.setattr(proof, "make_cases", made)
    monkeypatch.setattr(proof, "keep", lambda case, folder: None)
    monkeypatch.setattr(posterior_engine, "diagnose_flights", silent)
    monkeypatch.setenv("NANOBENCH_CACHE", str(tmp_path / "cache"))
    proof._flown.clear()
    ASKED.clear()


def runner(folder):
    return lambda items, title: run_items(items, folder / ".store", title=title)


def test_a_proof_that_was_killed_goes_on(tmp_path):
    specs = proof.plan(20, 3)
    sealed = proof.seal_cases(specs, runner(tmp_path), tmp_path)
    proof.diagnose_cases(sealed, runner(tmp_path), silent)
    assert len(ASKED) == 20
    kept = sorted((tmp_path / ".store").glob("*.json"))
    written = json.loads((tmp_path / proof.SEALED).read_text())
    for path in kept[::2]:
        path.unlink()
    again = proof.seal_cases(specs, runner(tmp_path), tmp_path)
    verdicts = proof.diagnose_cases(again, runner(tmp_path), silent)
    assert len(ASKED) <= 20 + len(kept[::2])
    assert json.loads((tmp_path / proof.SEALED).read_text()) == written
    assert (again.sha256, again.at) == (written["sha256"], written["sealed_at"])
    assert again.sha256 == seal(again.truths)
    assert [c.case for c in proof.open_and_score(again, verdicts, tmp_path)] == [s.name for s in specs]


def test_truths_that_are_not_the_sealed_ones_are_refused(tmp_path):
    sealed = proof.seal_cases(proof.plan(3, 0), runner(tmp_path), tmp_path)
    verdicts = proof.diagnose_cases(sealed, runner(tmp_path), silent)
    changed = {**verdicts, "case_001": replace(verdicts["case_001"], truth="0" * 64)}
    with pytest.raises(InputError, match="is not the sealed one"):
        proof.open_and_score(sealed, changed, tmp_path)
    path = tmp_path / proof.SEALED
    path.write_text(path.read_text().replace(sealed.sha256, "1" * 64))
    with pytest.raises(InputError, match="not the one written before the run"):
        proof.open_and_score(sealed, verdicts, tmp_path)


def test_a_batch_is_flown_once(tmp_path, monkeypatch):
    flown = []
    monkeypatch.setattr(proof, "make_cases", lambda specs: flown.append(len(specs)) or made(specs))
    sealed = proof.seal_cases(proof.plan(proof.TOGETHER, 0), runner(tmp_path))
    assert len(proof.diagnose_cases(sealed, runner(tmp_path), silent)) == proof.TOGETHER
    assert flown == [proof.TOGETHER]


def test_one_case_that_fails_does_not_stop_the_others(tmp_path):
    sealed = proof.seal_cases(proof.plan(3, 0), runner(tmp_path))
    verdicts = proof.diagnose_cases(sealed, runner(tmp_path), failing)
    assert sorted(verdicts) == ["case_000", "case_002"]
    assert proof.proof_of(sealed, proof.open_and_score(sealed, verdicts)).summary.cases == 2


def test_nb_prove_counts_what_a_diagnosis_that_never_names_is_worth(monkeypatch):
    monkeypatch.setattr(proved, "cores", lambda: 1)
    found = nb.prove(6, kind=["null", "single"], engine="practice", seed=2)
    kinds = found.table["cases"]
    assert kinds.sum() == 6
    assert found.table.loc["null", "right_share"] == 1.0  # nothing was there, nothing was named
    assert found.table.loc["single", "right"] == 0
    assert (found.table["false_names"] == 0).all()
    assert found.sentence == repr(found) == f"{kinds['null']} of 6 cases right, false names in 0"


def test_what_diagnoses_can_be_chosen(monkeypatch, capsys):
    monkeypatch.setattr(proved, "cores", lambda: 1)
    monkeypatch.setattr(posterior_engine, "diagnose_flights", another)
    nb.prove(2, kind="null", engine="practice", seed=2, diagnosed_by="posterior")
    assert ASKED.count("another") == 2
    with pytest.raises(UsageError, match="give one of posterior, rules"):
        nb.prove(2, diagnosed_by="a look")
    assert main(["prove", "--corrupted", "--engine", "rules", "--diagnosed-by", "posterior"]) == 2
    assert "give --diagnosed-by or --engine" in capsys.readouterr().err


def test_kinds_and_engines():
    assert proof.plan(12, 5) == plan_cases(12, 5)
    some = proof.plan(9, 5, ["null", "fault"])
    assert (len(some), {s.kind for s in some}) == (9, {"null", "fault"})
    assert [s.engine for s in proof.plan(3, 5, engine="both")] == ["practice", "rotorpy", "practice"]
    with pytest.raises(UsageError, match=r"'nul'; did you mean 'null'\? known: null, single"):
        proof.plan(9, 5, ["nul"])


def test_batches_hold_one_engine():
    batches = proof._batches(proof.plan(50, 1, engine="both"))
    assert all(len(b) <= proof.TOGETHER and len({s.engine for s in b}) == 1 for b in batches)
    assert sum(map(len, batches)) == 50


def test_the_verb(tmp_path, capsys):
    call = partial(main, ["prove", "--cases", "20", "--seed", "3", "--jobs", "1", "--out", str(tmp_path / "out")])
    assert call() == 0
    shown, said = capsys.readouterr()
    written = json.loads((tmp_path / "out" / "prove.json").read_text())
    sealed = json.loads((tmp_path / "out" / proof.SEALED).read_text())
    assert written["schema"] == "nanobench-prove/1"
    assert written["synthetic"] is True
    assert written["sealed"]["sha256"] == sealed["sha256"]
    assert sealed["sha256"] in said
    assert "SYNTHETIC data, 20 cases" in shown
    summary = written["summary"]
    assert (summary["false_names"], summary["unknown_on_foreign"]) == (0, 0.0)
    assert summary["right"] == sum(c["kind"] == "null" for c in written["cases"]) == 6
    assert set(written["cases"][0]) >= {"case", "kind", "truth", "outcome", "named", "cause", "right", "false_name",
                                        "elapsed_s"}
    assert call() == 0
    assert len(ASKED) == 20


def test_the_verb_refuses(tmp_path, capsys, monkeypatch):
    assert main(["prove", "--kind", "none", "--quiet"]) == 2
    assert "unknown kind 'none'; known: " in capsys.readouterr().err
    assert main(["prove", "--kind", "null", "--concealed", str(tmp_path)]) == 2
    assert "do not go together" in capsys.readouterr().err
    assert main(["prove", "--concealed", str(tmp_path / "absent")]) == 2
    assert "does not exist" in capsys.readouterr().err
    monkeypatch.setattr("importlib.util.find_spec", lambda name, found=importlib.util.find_spec: (
        None if name == "rotorpy" else found(name)))
    assert main(["prove", "--engine", "rotorpy"]) == 2
    assert how_to_install('rotorpy') in capsys.readouterr().err

"""Cases of a group, their engines, scores and tables."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from identification.prove.corrupted import cases, kept_results
from identification.prove.corrupted.beliefs import BELIEFS
from identification.prove.corrupted.case_score import score, score_all
from identification.prove.corrupted.cases import cases_of
from identification.prove.corrupted.corrupted_rates import CorruptedProof, rows
from identification.prove.corrupted.engines import Engine, engine_of
from identification.prove.corrupted.groups import dealt, without_copies
from identification.prove.corrupted.judge import Diagnosed, Judge, drawn, run
from identification.prove.corrupted.nominal import as_json, from_values
from identification.prove.corrupted.outside import OUTSIDE
from identification.prove.corrupted.vehicles import VEHICLES
from nanobench_tools.cli.main import main
from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.physics.numeric import equations
from nanobench_tools.physics.outside_terms import PLACE, ROOT

FEW = ("mass", "wind", "frame_tilt")


@pytest.fixture(scope="module")
def made(group, tmp_path_factory):
    """Cases of three beliefs, one shape outside and a force of time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NANOBENCH_CACHE", str(tmp_path_factory.mktemp("cache")))
        patch.setattr(cases, "BELIEFS", tuple(b for b in BELIEFS if b.name in FEW))
        patch.setattr(cases, "OUTSIDE", OUTSIDE[:1])
        patch.setattr(cases, "DISTURBANCES", cases.DISTURBANCES[:1])
        yield cases_of(group)


def finding(term, *equivalent, **parameters):
    return {"term": term, "equivalent": list(equivalent), "confidence": 0.9, "parameters": parameters}


def verdict(*findings, outcome="named"):
    return Diagnosed({"outcome": outcome, "findings": list(findings), "unknown": None}, None, 1.0)


def one(made, belief, times=8.0):
    return next(c for c in made if c.beliefs == (belief,) and c.times == times)


def test_a_group_has_controls_singles_pairs_and_shapes_outside(made, group):
    kinds = Counter(c.kind for c in made)
    assert kinds == {"control": 1, "single": 12, "outside": 6, "pair": 1}
    assert made[0].simulator == group.nominal
    assert all(c.rise >= 0.25 for c in made if c.times == 8.0)
    assert all(c.rise < 0.1 for c in made if c.times == 0.5)
    assert len({c.name for c in made}) == len(made)


def test_a_pair_has_two_effects(made):
    (pair,) = [c for c in made if c.kind == "pair"]
    assert len(pair.truth.effects) == 2
    assert {e.term for e in pair.truth.effects} <= set(FEW)
    assert {e.term for e in pair.truth.effects} != {"wind", "frame_tilt"}  # nearly the same push


def test_a_force_of_time_is_in_the_flights_and_not_in_the_simulator(made, group):
    case = one(made, "force of time, 1 s")
    assert case.simulator == group.nominal
    assert np.abs(case.recordings.tracks[0].position_m - group.recordings.tracks[0].position_m).max() > 1e-4
    assert case.key != one(made, "force of time, 1 s", 3.0).key


def test_shapes_outside_act_as_their_equations_say(nominal):
    state = [0.3, -0.2, 1.0, 0.6, 0.0, 0.8, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    hover = [0.1] * 4
    before = np.array(equations(nominal, 0.01).body(state, hover)[3:6], float)
    place = nominal.with_term(PLACE.name, f_N=0.02, k_1_m=4.0, phase=0.5)
    pushed = np.array(equations(place, 0.01).body(state, hover)[3:6], float)
    np.testing.assert_allclose(pushed - before, [0.5 * np.sin(-0.3), 0.5 * np.sin(1.7), 0.0], atol=1e-9)
    drag = nominal.with_term(ROOT.name, c=0.01)
    braked = np.array(equations(drag, 0.01).body(state, hover)[3:6], float)
    np.testing.assert_allclose(braked - before, [-0.25 * 0.6, 0.0, -0.25 * 0.8], atol=1e-6)


def test_a_model_survives_json(made):
    for case in (made[0], one(made, "wind"), one(made, "force of place")):
        assert from_values(as_json(case.simulator)) == case.simulator


def test_what_the_control_shows_is_not_false_in_the_others(made):
    control, wind, tilt = made[0], one(made, "wind"), one(made, "frame_tilt")
    found = {control.name: verdict(finding("inflow")), wind.name: verdict(finding("wind"), finding("inflow")),
             tilt.name: verdict(finding("frame_tilt", "force_world"), finding("inertia"))}
    first, second, third = score_all([control, wind, tilt], found)
    assert first.false == ("inflow",)
    assert (second.identified, second.false, second.imperfect) == (True, (), ("inflow",))
    assert (third.identified, third.false, third.imperfect) == (True, ("inertia",), ())


def test_a_visible_effect_without_its_name_is_missed(made):
    assert score(one(made, "wind"), verdict(outcome="unknown")).missed
    assert not score(one(made, "wind", 0.5), verdict(outcome="unknown")).missed
    assert score(one(made, "mass"), verdict(finding("thrust_scale"))).identified


def test_an_interval_is_compared_with_the_nominal_value(made):
    case = one(made, "frame_tilt")
    (effect,) = case.truth.effects
    inside = {name: {"value": p.value, "ci95": [p.value - 1e-3, p.value + 1e-3]}
              for name, p in effect.parameters.items()}
    assert [i.covered for i in score(case, verdict(finding("frame_tilt", **inside))).intervals] == [True, True]
    beside = {name: {"value": 0.3, "ci95": [0.2, 0.4]} for name in effect.parameters}
    assert [i.covered for i in score(case, verdict(finding("frame_tilt", **beside))).intervals] == [False, False]


def test_a_shape_outside_is_right_without_a_false_name(made):
    case = replace(one(made, "force of place"), near=("wind",))
    unknown = Diagnosed({"outcome": "unknown", "findings": [], "unknown": {"hint": "?"}}, None, 1.0)
    assert score(case, unknown).identified
    assert score(case, verdict(finding("wind"))).false == ()
    assert score(case, verdict(finding("inertia"))).false == ("inertia",)
    assert not score(case, verdict(outcome="none")).identified


def test_a_killed_run_goes_on(made, group, own_cache):
    asked = []

    def engine(recordings, simulator, seed):
        asked.append(simulator)
        if len(asked) == 3:
            raise InputError("flight", "is broken")
        return {"outcome": "named", "findings": [], "corrected": as_json(group.nominal), "pictures": "not kept"}

    judge = Judge(Engine("mine", engine, "code"), [group])
    some = [c for c in made if c.kind != "outside"][:4]
    first = run(judge, some)
    again = run(Judge(Engine("mine", engine, "code"), [group]), some)
    assert len(asked) == 4
    assert [d.verdict for d in first.values()] == [d.verdict for d in again.values()]
    assert [d.share for d in again.values()] == [None, pytest.approx(1.0), None, pytest.approx(1.0)]
    assert "is broken" in first[some[2].name].error
    foreign = one(made, "force of time, 1 s")
    assert run(judge, [foreign])[foreign.name].share is None
    broken = Judge(Engine("broken", lambda *given: {}["key"], "code"), [group])
    assert run(broken, some[:1])[some[0].name].error == "KeyError: 'key'"
    assert run(Judge(Engine("mine", engine, "other code"), [group]), some[:1])
    assert len(asked) == 6


def test_any_number_of_cases_spreads_over_beliefs(made):
    few = drawn(made, 7, 0)
    assert few[0].kind == "control"
    assert len({c.beliefs[0] if c.kind != "pair" else "pair" for c in few[1:]}) == 6
    assert all(c.rise >= 0.25 for c in few[1:])
    assert drawn(made, None, 0) != drawn(made, None, 1)
    assert {c.name for c in drawn(made, None, 0)} == {c.name for c in made}


def test_tables_count_cases_by_vehicle_size_and_belief(made):
    found = {c.name: verdict(*(finding(e.term) for e in c.truth.effects if not e.foreign)) for c in made}
    proof = CorruptedProof.of("mine", 0, score_all(made, found))
    assert proof.by_size["8"].identified.right == proof.by_size["8"].identified.n == 3
    assert proof.by_belief["wind"].cases == 4
    assert proof.by_vehicle["made_up"].false.right == 0
    assert [row[0] for row in rows(proof.by_size)] == ["0.5", "1.25", "3", "8"]
    assert proof.calibration[0][1] == 1.0


def test_engines_are_found_by_name(monkeypatch):
    assert engine_of("rules").name == "rules"
    assert engine_of("posterior").code != engine_of("rules").code
    assert engine_of("identification.prove.corrupted.engines:by_rules").diagnose is engine_of("rules").diagnose
    for wrong in ("rule", "nowhere:diagnose", "identification.prove.corrupted.engines:nothing"):
        with pytest.raises(UsageError, match="--engine"):
            engine_of(wrong)


def test_code_that_changes_makes_another_key(tmp_path, monkeypatch):
    (tmp_path / "a").mkdir()
    file = tmp_path / "a" / "b.py"
    monkeypatch.setattr(kept_results, "ROOT", tmp_path)
    found = []
    for text in ("1", "2", "1"):
        file.write_text(text)
        kept_results.code_hash.cache_clear()
        found.append(kept_results.code_hash(("a",)))
        assert kept_results.code_hash(("a/*",)) == kept_results.code_hash(("a/b.py",)) == found[-1]
    kept_results.code_hash.cache_clear()
    assert found[0] == found[2] != found[1]


def test_no_group_has_a_training_flight(tmp_path):
    for name, text in (("a", "1"), ("b", "2"), ("c", "1"), ("d", "3"), ("e", "4")):
        (tmp_path / name).write_text(text)
    files = sorted(tmp_path.iterdir())
    train, group = dealt(files, 2, [3, 3])
    assert [p.name for p in train] == ["a", "c", "e"]
    assert [p.name for p in without_copies([files[1], files[2]], [files[0]])] == ["b"]
    assert not set(train) & set(group)


@pytest.mark.real
@pytest.mark.slow
def test_a_real_vehicle_from_files_to_scores(real_data, own_cache):
    from identification.prove.corrupted import groups_of

    source = next(v for v in VEHICLES if v.name == "brushless")
    (group,) = groups_of(source, real_data, 1)
    mass = [c for c in cases_of(group) if c.beliefs == ("mass",) and c.times == 8.0]
    found = run(Judge(engine_of("rules"), [group]), mass)
    assert score(mass[0], found[mass[0].name]).identified


@pytest.mark.parametrize(("words", "error"), [
    (["--vehicle", "brushless"], "belong to --corrupted"),
    (["--engine", "rules"], "belongs to --corrupted"),
    (["--corrupted", "--kind", "null"], "goes with none of"),
    (["--corrupted", "no_such_folder"], "is no folder"),
    (["--corrupted", ".", "--vehicle", "airliner"], "airliner is unknown"),
    (["--corrupted", ".", "--engine", "rulez"], "--engine rulez is unknown"),
    (["--case", "omnisim_thrust"], "belongs to --shipped"),
    (["--shipped", "--corrupted"], "goes with none of"),
    (["--shipped", "no_such_folder"], "--shipped no_such_folder: is no folder"),
    (["--shipped", ".", "--case", "airliner"], "airliner is unknown"),
    (["--shipped", ".", "--case", "omnisim_thrust"], "has no recordings")])
def test_a_wrong_word_is_one_line(words, error, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["prove", *words]) == 2
    said = capsys.readouterr().err
    assert error in said
    assert "Traceback" not in said


def test_a_folder_without_known_vehicles_says_what_it_should_have(tmp_path, capsys):
    assert main(["prove", "--corrupted", str(tmp_path)]) == 2
    assert "crazyflie_usd/brushless_flights" in capsys.readouterr().err


def test_a_vehicle_with_too_little_flight_does_not_stop_the_others(monkeypatch, real_data, capsys):
    from identification.prove import corrupted

    def groups_of(source, *_):
        if source.name == "payload":
            raise InputError("recordings", "11 s of clean flight", "give at least 15 s")
        return []

    monkeypatch.setattr(corrupted, "groups_of", groups_of)
    assert main(["prove", "--corrupted", str(real_data), "--vehicle", "payload", "--vehicle", "brushless"]) == 2
    assert "payload is left out: recordings: 11 s of clean flight" in capsys.readouterr().err

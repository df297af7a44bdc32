"""The diagnosis by posterior on tracks whose truth is known: what is wrong comes back, what is right is left alone.

The path of these tracks does not belong to their attitude, so predictions far ahead say little there."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from carried_tracks import MODEL, track_of
from scipy.spatial.transform import Rotation

from identification.mismatch import verdict
from identification.mismatch.drawings import drawings
from identification.mismatch.page import page_text
from identification.mismatch.pictures import pictures
from identification.mismatch.posterior import decision
from identification.mismatch.posterior.certainty import sizes_of
from identification.mismatch.posterior.decision import decide
from identification.mismatch.posterior.posterior_engine import _unknown, diagnose, verdict_body, weighed
from identification.mismatch.posterior.sizing import refine
from identification.mismatch.recordings import Recordings
from identification.mismatch.space import with_other_map
from identification.mismatch.wrench import CHANNELS, Wrench
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, Provenance
from nanobench_tools.physics.model import find_term
from tools.docs_site.docstring_text import entries, sections


def recordings_of(tracks) -> Recordings:
    flights = tuple(Flight(t.name, {}, {}, Provenance(t.name, "", "made")) for t in tracks)
    return Recordings(flights, {}, tuple(tracks), (), {})


@pytest.fixture(scope="module")
def flown():
    """Four flights of MODEL."""
    return recordings_of([track_of(MODEL, 30 + k, k, seconds=12.0) for k in range(4)])


@pytest.mark.slow
def test_a_right_simulator_is_left_alone(flown):
    body = verdict_body(flown, MODEL)
    assert body["findings"] == []
    assert body["outcome"] == "none"
    assert body["improvement"]["50"]["before"] == body["improvement"]["50"]["after"]


@pytest.mark.slow
def test_the_place_of_the_tracked_point_is_stated(flown):
    """A point 4 mm ahead of the centre of mass and 15 mm above it, moved there with SciPy's rotations."""
    arm_m = np.array([0.004, 0.0, 0.015])
    tracks = []
    for t in flown.tracks:
        turned = Rotation.from_quat(t.quaternion)
        tracks.append(replace(t, position_m=t.position_m + turned.apply(arm_m),
                              velocity_m_s=t.velocity_m_s + turned.apply(np.cross(t.rate_rad_s, arm_m))))
    at_centre, off_centre = verdict_body(flown, MODEL), verdict_body(recordings_of(tracks), MODEL)
    for body, truth in ((at_centre, np.zeros(3)), (off_centre, arm_m)):
        sd = np.array(body["tracked_point_sd_m"])
        assert np.all(np.abs(body["tracked_point_m"] - truth) < 2.5 * sd)
        assert sd[2] < 0.003
    assert "The tracked point lies " in off_centre["paragraph"]


@pytest.fixture(scope="module")
def too_heavy(flown):
    return diagnose(flown, MODEL.on(mass_kg=0.046))


def test_every_key_of_the_verdict_is_documented(too_heavy):
    told = entries(sections(verdict.__doc__)["Attributes"])
    assert set(too_heavy.body) - set(told) == set()
    finding, = too_heavy.body["findings"]
    inner = {"members", "force_m_s2", "torque_rad_s2"}  # of the decision, for prove
    assert [key for key in finding if f"``{key}``" not in told["findings"][1] and key not in inner] == []


def test_a_wrong_mass_is_found_with_its_size_and_predicts_better(too_heavy):
    finding, = too_heavy.body["findings"]
    assert {finding["term"], *finding["equivalent"]} == {"thrust_scale", "mass"}
    low, high = finding["parameters"]["mass.m"]["ci95"] if finding["term"] == "mass" else [
        0.046 / s for s in reversed(finding["parameters"]["thrust_scale.s"]["ci95"])]
    assert low < 0.04 < high
    assert high - low < 0.005  # thrust differs by 2.2 % between sessions; mass and thrust_scale are a toss-up
    assert too_heavy.corrected is not None
    soon = too_heavy.body["improvement"]["10"]
    assert soon["after"]["velocity_m_s"] < soon["before"]["velocity_m_s"]
    assert too_heavy.body["headline"].startswith("The simulator is wrong about ")
    assert "thrust scale" in too_heavy.body["headline"]


@pytest.mark.slow
def test_the_order_of_flights_changes_nothing(flown, too_heavy):
    tracks = [replace(t, flight=3 - t.flight) for t in flown.tracks[::-1]]
    body = verdict_body(recordings_of(tracks), MODEL.on(mass_kg=0.046))
    one, other = (next(iter(b["findings"][0]["parameters"].values()))["value"] for b in (too_heavy.body, body))
    assert one == pytest.approx(other, rel=1e-3)


@pytest.mark.slow
def test_an_effect_of_too_many_kinds_is_unknown_and_said_first(flown, monkeypatch):
    """Mass and thrust_scale are one kind; here none may stay open."""
    monkeypatch.setattr(decision, "KINDS", 0)
    body = verdict_body(flown, MODEL.on(mass_kg=0.046))
    assert (body["outcome"], body["findings"], body["corrected_simulator"]) == ("unknown", [], None)
    unknown = body["unknown"]
    assert [set(terms) for terms in unknown["between"]] == [{"mass", "thrust_scale"}]
    assert unknown["bound_m_s2"] == pytest.approx(2.0 * 9.81 * 0.006 / 0.046, rel=0.2)  # thrust differs by session
    assert unknown["where"]["axes"] == ["force z"]
    assert body["headline"].startswith("The simulator is wrong, and these flights do not show what is missing: ")
    assert "mass" in body["headline"]
    assert unknown["hint"] in body["paragraph"]
    assert {"mass", "thrust_scale"} & {t["term"] for t in body["not_named"]}


def test_what_is_turned_down_has_a_reason(too_heavy):
    reasons = {entry["term"]: entry["why"] for entry in too_heavy.body["not_named"]}
    assert {"thrust_scale", "mass"}.isdisjoint(reasons)
    assert {"wind", "drag_linear", "inertia", "motor_lag"} <= set(reasons)
    assert all(reasons.values())


@pytest.mark.slow
def test_a_lag_is_sized_and_its_ratio_left_open(flown):
    """What flies lags by 0.04 s up and down. A simulator with 0.08 and 0.16 s is too slow. With 0.04 and 0.12 s it has
    only the ratio of large steps, which no small command shows."""
    def best(up_s, down_s):
        simulator = MODEL.with_parameters({"motor_lag.tau_up_s": up_s, "motor_lag.tau_down_s": down_s})
        case, _ = weighed(flown, Wrench(flown.tracks), simulator, 0)
        readings = [i for i, e in enumerate(case.effects) if e.term == "motor_lag"]
        found = max((refine(case, (i,)) for i in readings), key=lambda found: found.log)
        return found.log, sizes_of(case, found.chosen[0], found)

    log, sizes = best(0.08, 0.16)
    assert log > 1.0
    for size in sizes.values():
        assert abs(size.value - 0.04) < size.half
        assert size.share > 1.0
    assert best(0.04, 0.12)[0] < 1.0


def test_another_number_of_motors_is_refused(flown):
    six = [replace(t, motor=np.concatenate([t.motor, t.motor[:, :2]], axis=1)) for t in flown.tracks]
    with pytest.raises(InputError, match="has 6 motors, and the simulator 4 rotors"):
        diagnose(recordings_of(six), MODEL)


def test_the_page_of_a_verdict_is_written(too_heavy, flown):
    text = page_text(too_heavy, flown, synthetic=True)
    assert "thrust_scale" in text
    assert "SYNTHETIC" in text
    assert "Nothing of these flights was judged" not in text
    assert "Every flight is predicted by a fit that has not seen it" in text
    assert 'id="table-discrepancy"' in text
    drawn = pictures(too_heavy, flown)
    assert {"errors", "rms", "timeline", "room", "scores", "intervals"} <= set(drawings(drawn, [(1, ""), (10, ""),
                                                                                               (50, "")], "", ""))
    # 15 % of the weight is missing before, and nothing that noise does not make after
    z = CHANNELS.index("force z")
    assert drawn["rms"]["before"][z] == pytest.approx(9.81 * 0.006 / 0.046, rel=0.1)
    assert drawn["rms"]["floor"][z] <= drawn["rms"]["after"][z] < 0.2 * drawn["rms"]["before"][z]


@pytest.mark.parametrize(("again", "left"), [
    ([frozenset({"wind", "force_world", "frame_tilt"})], 2), ([], 1)])
@pytest.mark.slow
def test_of_two_effects_the_smaller_one_has_to_be_named_again(pushed_and_heavy, again, left):
    case, ahead = pushed_and_heavy
    found = decide(case, ahead.judge, ahead.worse, lambda corrected: again)
    assert len(found.findings) == left
    assert {"thrust_scale", "mass"} & {t for f in found.findings for t in (f.term, *f.equivalent)}
    if not again:
        assert any(why.startswith("no longer identified once") for why in found.rejected.values())


@pytest.fixture(scope="module")
def pushed_and_heavy():
    """A simulator that is too heavy, and does not know a steady push."""
    tracks = [track_of(MODEL, 60 + k, k, seconds=12.0, push=lambda t, *state: np.array([0.8, 0.0, 0.0]))
              for k in range(3)]
    return weighed(recordings_of(tracks), Wrench(tracks), MODEL.on(mass_kg=0.046), 0)


@pytest.mark.slow
def test_a_battery_that_was_ignored_is_found_and_can_be_flown(flown):
    """The corrected simulator has another thrust map than the simulator; the battery falls from 4.0 to 3.5 V."""
    blind = with_other_map(MODEL, 3.75)
    found = diagnose(flown, blind)
    assert [f["term"] for f in found.body["findings"]] == ["thrust_voltage"]
    assert "thrust_voltage" in found.corrected
    assert "thrust_pwm" not in found.corrected
    share = found.body["findings"][0]["parameters"]["thrust_voltage.share"]["value"]
    assert share == pytest.approx(1.0, abs=0.2)  # place and time go with the battery's fall on these tracks
    after = pictures(found, flown)["rms"]
    z = CHANNELS.index("force z")
    assert after["after"][z] < 0.5 * after["before"][z]


@pytest.mark.slow
def test_a_limit_of_thrust_is_found_from_a_simulator_without_one():
    """Hover takes 0.098 N a motor; commands go some hundredths beyond."""
    limited = MODEL.with_term("saturation", T_max_N=0.1)
    tracks = [track_of(limited, 80 + k, k, seconds=12.0) for k in range(3)]
    found = diagnose(recordings_of(tracks), MODEL)
    assert [f["term"] for f in found.body["findings"]] == ["saturation"]
    assert found.corrected.parameters["saturation.T_max_N"] == pytest.approx(0.1, rel=0.01)


@pytest.mark.slow
def test_a_limit_below_hover_is_the_finding_although_commands_are_logged_with_noise(flown):
    """Thrust follows such commands less than it should, and a limit halfway suits that better than none. Hover takes
    0.098 N a motor. There is no limit, so any higher one is possible."""
    rng = np.random.default_rng(5)
    tracks = [replace(t, motor=np.clip(t.motor + 0.02 * rng.standard_normal(t.motor.shape), 0.0, 1.0))
              for t in flown.tracks]
    found = diagnose(recordings_of(tracks), MODEL.with_term("saturation", T_max_N=0.06))
    assert [f["term"] for f in found.body["findings"]] == ["saturation"]
    low, high = found.body["findings"][0]["parameters"]["saturation.T_max_N"]["ci95"]
    assert low > 0.1
    assert high == find_term("saturation").parameters[1].neutral


@pytest.mark.parametrize(("force", "strained", "hidden", "unknown"), [
    (0.29, 0.0, {}, False), (0.2, 0.25, {}, True), (0.1, 0.0, {"thrust_voltage": "too small"}, True)])
def test_what_is_left_is_unknown_if_it_is_large_or_may_hide_an_effect(force, strained, hidden, unknown):
    """Groups of 0.3 and 0.2 m/s^2 that oppose each other do not count, their sum does."""
    left = {"place": 0.3, "time": 0.2, "turn_air": 9.0, "force": force, "strained": strained}
    found = _unknown(SimpleNamespace(left_open=(), hidden=hidden), left, None,
                     SimpleNamespace(names=["one"]))
    assert (found is not None) == unknown
    if found:
        assert found["where"]["kind"] == "place"
        assert found["bound_m_s2"] == pytest.approx(2.0 * np.hypot(force, strained))
        assert found["hides"] == list(hidden)
        assert (not hidden or "it may hide thrust by battery voltage: too small" in found["hint"])

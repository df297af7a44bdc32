"""Which effects are identified, given sizes and probabilities, against hand-worked cases."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from identification.mismatch.posterior import certainty, decision, indistinguishable, weighing
from identification.mismatch.posterior.background import Background
from identification.mismatch.posterior.effects import Effect
from identification.mismatch.posterior.set_evidence import Evidence


def masked(monkeypatch, left_m_s2, sign, strained_force, strained_moment=0.0):
    """Numbers of the effects that go first. Strained errors push along x, m/s^2, and turn about y, rad/s^2."""
    def effect(term: str, push: float, turn: float) -> Effect:
        force, torque = np.zeros((4, 3, 1)), np.zeros((4, 3, 1))
        force[:, 0, 0], torque[:, 1] = push * np.array([1.0, sign, 1.0, sign]), turn
        return Effect(term, force, torque, {}, np.array([-9.0]), np.array([9.0]))

    left = np.array([*np.array(left_m_s2) / np.sqrt(3.0), 9.0])
    monkeypatch.setattr(certainty, "strained", lambda case, found: (
        np.tile([strained_force, 0.0, 0.0], (4, 1)), np.tile([0.0, strained_moment, 0.0], (4, 1))))
    monkeypatch.setattr(certainty, "nuisance", lambda case, found: left)
    background = Background(np.tile(np.eye(3, 4), (4, 1, 1)), np.zeros((0, 3, 4)),
                            np.array(["place", "air", "late", "tilt"]))
    effects = [effect("wind", 0.5, 0.0), effect("mass", 1.8, 0.0), effect("com_offset", 0.0, 9.0)]
    case = SimpleNamespace(effects=effects, background=background, arm=np.full(3, 0.03),
                           evidence=SimpleNamespace(P=0))
    found = SimpleNamespace(chosen=(0, 1, 2), step=np.ones(3))
    return list(certainty.overshadowed(case, found))


@pytest.mark.parametrize(("left_m_s2", "sign", "strained_m_s2", "rejected"), [
    ((0.29, 0.29, 0.29), -1.0, 0.0, []), ((0.31, 0.31, 0.31), -1.0, 0.0, []), ((0.34, 0.34, 0.34), -1.0, 0.0, [0]),
    ((1.0, 1.0, 1.0), -1.0, 0.0, [0]), ((0.0, 0.0, 9.0), -1.0, 0.0, []), ((0.0, 1.0, 1.0), 1.0, 0.0, []),
    ((1.0, 0.0, 0.0), 1.0, 0.0, [0]),
    ((0.0, 0.0, 0.0), 1.0, 0.33, []), ((0.0, 0.0, 0.0), 1.0, 0.34, [0])])
def test_a_force_is_identified_only_where_it_outweighs_what_no_effect_explains(monkeypatch, left_m_s2, sign,
                                                                               strained_m_s2, rejected):
    """Pushes of 0.5 and 1.8 m/s^2 along x that change their sign, and a moment, which no force hides: the weaker push
    goes first. One along z cannot imitate it, nor one without a mean a constant push. Numbers are for a force of that
    length, equal along all axes; the fifth along z, the sixth next to constant pushes. The seventh is a force of the
    place, along x, and the last two are errors of terms that are too large: they imitate constant pushes, too."""
    assert masked(monkeypatch, left_m_s2, sign, strained_m_s2) == rejected


@pytest.mark.parametrize(("moment", "rejected"), [(5.9, []), (9.5, []), (10.1, [2])])
def test_a_moment_is_identified_only_where_it_outweighs_errors_that_are_too_large(monkeypatch, moment, rejected):
    """9 rad/s^2 at 3 cm are .27 m/s^2; errors of less than .3 m/s^2 do not matter."""
    assert masked(monkeypatch, (0.0, 0.0, 0.0), -1.0, 0.0, moment) == rejected


@pytest.mark.parametrize(("left_m_s2", "alike"), [(0.1, {}), (0.3, {"frame_tilt": 0.0}), (1.1, {})])
def test_what_differs_by_less_than_physics_without_a_name_cannot_be_distinguished(left_m_s2, alike):
    """Along x a push of 1 m/s^2, one that comes and goes by 0.2 about 1, and one that changes its sign; where what no
    effect explains is larger than the push itself, nothing is compared with it."""
    force = np.zeros((4, 3, 3))
    force[:, 0] = np.array([[1.0, 1.0, 1.0, 1.0], [1.2, 0.8, 1.2, 0.8], [1.0, -1.0, 1.0, -1.0]]).T
    terms = "force_world", "frame_tilt", "drag_linear"
    effects = [Effect(t, force[..., [k]], np.zeros((4, 3, 1)), {}, np.array([-9.0]), np.array([9.0]))
               for k, t in enumerate(terms)]
    work = np.concatenate([np.einsum("nki,nkj->kij", force, force) / 4.0, np.zeros((3, 3, 3))])
    evidence = SimpleNamespace(columns=lambda chosen: np.array(chosen), unit=np.ones(3), work=work,
                               lower=np.full(3, -9.0), upper=np.full(3, 9.0))
    case = SimpleNamespace(effects=effects, evidence=evidence)
    chosen = SimpleNamespace(chosen=(0,), step=np.ones(1))
    assert indistinguishable.alike(case, chosen, 0, (left_m_s2, 0.0)) == alike


@pytest.mark.parametrize(("together", "alike"), [(34.0, {"motor_lag": 0.0}), (22.0, {})])
def test_thrust_that_is_late_as_neither_a_lag_nor_a_delay_is_both(together, alike):
    """Delay 20 nats, lag 17, each with a prior of -4, and both together more or not."""
    logs = {(0,): 20.0, (1,): 17.0, (0, 1): together, (2,): 3.0}
    effects = [SimpleNamespace(term=t) for t in ("command_delay", "motor_lag", "wind")]
    case = SimpleNamespace(effects=effects, evidence=SimpleNamespace(log_prior=lambda chosen: -4.0 * len(chosen)))
    weighed = SimpleNamespace(case=case, sizes=lambda chosen: SimpleNamespace(log=logs[chosen]))
    assert indistinguishable.between(weighed, 0) == alike
    assert indistinguishable.between(weighed, 2) == {}


@pytest.mark.usefixtures("nothing_cancels")
def test_an_effect_that_only_predictions_speak_for_gives_way(monkeypatch):
    """Predictions favour a wind by 30 nats, a drag by 20, but the residual shows no wind: 0.1 +- 0.5 m/s beside 0."""
    monkeypatch.setattr(weighing, "PREDICTED", 0)
    sets = {(): 0.0, (0,): -3.0, (1,): -3.0, (0, 1): -6.0}
    case = SimpleNamespace(evidence=SimpleNamespace(sets=sets, any_opposed=lambda s: False, score=sets.__getitem__),
                           effects=[SimpleNamespace(term=t, far=False) for t in ("wind", "drag_linear")])
    monkeypatch.setattr(weighing.Weighing, "sizes", lambda self, chosen: chosen)
    monkeypatch.setattr(decision, "inside_bounds", lambda weighed, best: best)
    sizes = certainty.Size(0.0, 0.1, 0.5, "m/s"), certainty.Size(0.0, 0.015, 0.004, "N s/m")
    monkeypatch.setattr(certainty, "sizes_of", lambda case, i, found, told: {"x": sizes[i]})
    monkeypatch.setattr(certainty, "_sure", lambda case, i, found, told: sizes[i].share)
    for module in (decision, certainty):
        monkeypatch.setattr(module, "certainty", lambda case, i, found, told: sizes[i].share)
    weighed = weighing.Weighing(case, lambda one, other: {(0,): 30.0, (1,): 20.0}.get(one, 0.0))
    best, posterior, unsure = decision._certain_of_size(weighed, lambda found, without: (0.0,))
    assert best == (1,)
    assert set(posterior) == {(), (1,)}
    assert unsure == {"wind": "the 95 % interval includes the simulator's value: x 0.1 +- 0.5 m/s"}


@pytest.mark.parametrize(("errors", "goes"), [((1.4, 1.3), None), ((1.6, 1.3), 0), ((1.6, 1.7), 1)])
def test_the_effect_that_spoils_predictions_most_goes(errors, goes):
    """Times the error without each of two effects. From 1.5 on it is none."""
    weighed = SimpleNamespace(sizes=lambda chosen: chosen)
    assert decision._spoiling(weighed, (0, 1), lambda found, without: (0.0, np.log(errors[1 - without[0]])),
                              False) == goes
    assert decision._spoiling(weighed, (), lambda found, without: (9.0,), True) is None


@pytest.mark.usefixtures("nothing_cancels")
@pytest.mark.parametrize(("mass", "wind", "best"), [(1.4, 1.0, (0,)), (1.6, 0.8, (1,)), (1.6, 1.0, ())])
def test_after_one_that_spoilt_predictions_others_have_to_improve_them(monkeypatch, mass, wind, best):
    """A mass has more evidence than a wind; numbers are times the errors of no effect."""
    monkeypatch.setattr(weighing, "PREDICTED", 0)
    sets = {(): 0.0, (0,): 90.0, (1,): 40.0}
    case = SimpleNamespace(evidence=SimpleNamespace(sets=sets, any_opposed=lambda s: False, score=sets.__getitem__),
                           effects=[SimpleNamespace(term=t, far=False) for t in ("mass", "wind")])
    monkeypatch.setattr(weighing.Weighing, "sizes", lambda self, chosen: chosen)
    monkeypatch.setattr(decision, "inside_bounds", lambda weighed, best: best)
    monkeypatch.setattr(decision, "certainty", lambda case, i, found, told: 9.0)
    monkeypatch.setattr(decision, "uncertain", lambda case, i, found, told: None)
    weighed = weighing.Weighing(case, lambda one, other: 0.0)
    errors = {(): 1.0, (0,): mass, (1,): wind}
    found = decision._certain_of_size(weighed, lambda found, without: (np.log(errors[found] / errors[without]), 0.0))
    assert found[0] == best


def test_an_effect_that_gave_way_does_not_come_back_for_one_on_its_bound(monkeypatch):
    """The wind is uncertain; the drag, about as probable, would have to lie on its bound."""
    monkeypatch.setattr(weighing, "PREDICTED", 0)
    sets = {(): 0.0, (0,): 20.0, (1,): 19.0}
    evidence = SimpleNamespace(sets=sets, score=sets.__getitem__, any_opposed=lambda s: False,
                               allowed=lambda chosen: True)
    case = SimpleNamespace(evidence=evidence,
                           effects=[SimpleNamespace(term=t, far=False) for t in ("wind", "drag_linear")])
    case.evidence.effects = case.effects
    monkeypatch.setattr(weighing.Weighing, "sizes", lambda self, chosen: chosen)
    monkeypatch.setattr(indistinguishable, "on_bound", lambda case, i, found: i == 1)
    monkeypatch.setattr(decision, "certainty", lambda case, i, found, told: float(i))
    monkeypatch.setattr(decision, "uncertain", lambda case, i, found, told: None if i else "uncertain")
    best, _, unsure = decision._certain_of_size(weighing.Weighing(case, lambda one, other: 0.0),
                                                 lambda found, without: (0.0,))
    assert (best, unsure) == ((1,), {"wind": "uncertain"})


@pytest.mark.parametrize(("part", "certain"), [([2.2, 0.0], False), ([2.6, 0.0], True), ([1.9, 1.9], False)])
@pytest.mark.usefixtures("nothing_cancels")
def test_several_directions_have_to_leave_their_common_region(part, certain):
    """Two independent directions of unit error: the 95 % region ends at 2.45, the root of 5.99; one alone at 1.96."""
    assert certainty_of(part, np.eye(2), 1.0) == certain


@pytest.mark.parametrize(("evidence", "certain"), [(4.0, False), (6.0, True)])
@pytest.mark.usefixtures("nothing_cancels")
def test_flights_that_differ_by_as_much_show_only_what_is_beyond_doubt(evidence, certain):
    """2.6 of unit error, with twice that from flight to flight."""
    assert certainty_of([2.6, 0.0], 5.0 * np.eye(2), evidence) == certain


@pytest.mark.parametrize(("part", "told", "distance"), [([1.5, 0.0], 4.0, 10.25), ([1.5, 0.0], -4.0, 2.25),
                                                        ([1.4, 0.0], 90.0, 1.96)])
def test_predictions_count_where_the_residual_is_more_than_noise(part, told, distance):
    """Squared distance from zero of two directions of unit error; noise has 2. Predictions add twice their nats."""
    covariance = certainty.narrowed(np.array(part), np.eye(2), told)
    assert part @ np.linalg.solve(covariance, part) == pytest.approx(distance)
    assert covariance[1, 1] == 1.0


@pytest.mark.parametrize(("part", "told", "half"), [(2.0, 90.0, 1.96), (1.5, 4.0, 1.96 * 1.5 / 10.25**0.5),
                                                    (0.9, 90.0, 1.96)])
def test_predictions_narrow_only_an_interval_that_includes_the_simulator(part, told, half):
    """One direction of unit error."""
    model = SimpleNamespace(parameters={"a": 0.0}, names=("a",), units=("1",))
    case = SimpleNamespace(effects=[SimpleNamespace(width=1, map_share=False, moves={"a": np.ones(1)})],
                           space=SimpleNamespace(model=model), simulator=SimpleNamespace(parameters={}))
    found = SimpleNamespace(chosen=(0,), step=np.array([part]), covariance=np.eye(1))
    assert certainty.sizes_of(case, 0, found, lambda: told)["a"].half == pytest.approx(half)


@pytest.fixture
def nothing_cancels(monkeypatch):
    """As if no term had an error."""
    monkeypatch.setattr(certainty, "_cancelled", lambda case, which, found: False)


@pytest.mark.parametrize(("errors", "far", "cancelled"), [
    ((0.0, 0.0), False, False), ((0.0, -0.45), False, False), ((0.0, -0.55), False, True), ((-0.9, 0.0), False, True),
    ((0.3, -1.1), False, True), ((0.3, 0.9), False, False), ((-0.9, 0.0), True, False)])
def test_an_effect_that_errors_of_terms_cancel_is_no_explanation(monkeypatch, errors, far, cancelled):
    """A push of 1 m/s^2 by the first of two terms that act alike: half of it is the most that may be taken back. Errors
    bend an effect far from linear."""
    evidence = SimpleNamespace(P=2, unit=np.full(2, 0.5), columns=lambda chosen: np.array(chosen),
                               work=np.stack([np.ones((2, 2)), *np.zeros((5, 2, 2))]))
    evidence.opposed = partial(Evidence.opposed, evidence)
    monkeypatch.setattr(certainty, "nuisance", lambda case, found: np.array([*errors, 7.0]))
    case = SimpleNamespace(evidence=evidence, effects=[SimpleNamespace(width=1, far=far)] * 2)
    found = SimpleNamespace(chosen=(0,), step=np.array([2.0]))
    assert certainty._cancelled(case, 0, found) == cancelled


def certainty_of(part, spread, evidence):
    model = SimpleNamespace(parameters={"a": 0.0, "b": 0.0}, names=("a", "b"), units=("1", "1"))
    case = SimpleNamespace(effects=[SimpleNamespace(width=2, map_share=False, far=False, term="x",
                                                    moves={"a": np.array([1.0, 0.0]), "b": np.array([0.0, 1.0])})],
                           space=SimpleNamespace(model=model), simulator=SimpleNamespace(parameters={}),
                           evidence=SimpleNamespace(weighed=lambda chosen: (evidence, None, None)))
    found = SimpleNamespace(chosen=(0,), step=np.array(part), covariance=np.eye(2), model=model,
                            spread=lambda case: spread)
    return certainty.certainty(case, 0, found) > 1.0


@pytest.mark.parametrize(("far", "part", "ratio"), [(True, 0.5, 0.75), (True, 1.0, 1.5), (False, 0.1, np.inf)])
def test_an_effect_far_from_linear_exceeds_what_its_term_may_be_off(far, part, ratio):
    """0.3 m/s^2 a unit; the term may be off by 0.2 m/s^2."""
    evidence = SimpleNamespace(unit=np.array([0.3]), spike=np.array([0.2]), columns=lambda chosen: np.array([0]))
    case = SimpleNamespace(evidence=evidence, effects=[SimpleNamespace(far=far, width=1, term="motor_lag")])
    found = SimpleNamespace(chosen=(0,), step=np.array([part]))
    assert certainty.over_error(case, 0, found) == pytest.approx(ratio)


def test_terms_of_a_family_share_what_flights_show():
    """A set has one of them: their probabilities add up, and the odds between them are what the flights tell."""
    by_term = {"thrust_voltage": 0.54, "thrust_scale": 0.26, "mass": 0.17, "thrust_pwm": 0.02, "wind": 0.9}
    found = indistinguishable.of_family("thrust_voltage", by_term)
    assert set(found) == {"thrust_scale", "mass"}
    assert found["mass"] == pytest.approx(np.log(0.54 / 0.17))
    assert set(indistinguishable.of_family("mass", by_term)) == {"thrust_scale", "thrust_voltage", "thrust_pwm"}


@pytest.mark.parametrize(("terms", "kinds"), [
    (("mass",), 1), (("mass", "thrust_scale"), 1), (("drag_linear", "drag_rotor", "com_offset", "motor_imbalance"), 2),
    (("motor_lag", "mass", "rotor_gyro", "thrust_scale"), 3),
    (("saturation", "thrust_voltage", "inertia", "yaw_torque", "drag_torque", "com_offset", "motor_imbalance"), 5)])
def test_terms_of_one_family_and_twins_are_one_kind(terms, kinds):
    """Counted by hand, in any order."""
    assert {indistinguishable.kinds_of(order) for order in (terms, terms[::-1], sorted(terms))} == {kinds}


@pytest.mark.parametrize(("term", "nats"),
                         [("drag_rotor", 30.0), ("motor_lag", 0.0), ("mass", 0.0), ("com_offset", 0.0)])
def test_predictions_show_no_size_of_what_noise_or_a_session_feigns(monkeypatch, term, nats):
    """They favour each by 30 nats."""
    monkeypatch.setattr(weighing.Weighing, "sizes", lambda self, chosen: chosen)
    weighed = weighing.Weighing(SimpleNamespace(effects=[SimpleNamespace(term=term)]),
                                lambda one, other: 30.0 * (len(one) - len(other)))
    assert weighed.gained((0,), 0) == nats

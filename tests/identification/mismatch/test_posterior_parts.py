"""Parts of the diagnosis by posterior against hand-worked cases and SciPy."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from carried_tracks import MODEL, wrench_of
from scipy.signal import lfilter
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, truncnorm

from identification.mismatch.memory import runs_of
from identification.mismatch.page import GOES_WITH
from identification.mismatch.posterior import decision, set_evidence, weighing
from identification.mismatch.posterior.arm_unit import arms
from identification.mismatch.posterior.background import (
    FIXED,
    LIFT_OF_ALL,
    Background,
    _beside,
    _equal_lag,
    background_of,
    fourier,
)
from identification.mismatch.posterior.build import _seen, build
from identification.mismatch.posterior.effects import Effect, effects_of, within_reach
from identification.mismatch.posterior.gain_error import gain_error
from identification.mismatch.posterior.left_out_flights import _as_sessions_differ, _calmed, _lift_gain
from identification.mismatch.posterior.rows import Rows, Seen, _Group, _ridge, instruments, rows_of
from identification.mismatch.posterior.set_evidence import Evidence
from identification.mismatch.posterior.sizing import _shortened
from identification.mismatch.posterior.thrust_exponent import Curve
from identification.mismatch.space import space_around
from identification.mismatch.wrench import TORQUE_ROWS, Wrench
from nanobench_tools import so3
from nanobench_tools.physics import Model, Vehicle


def test_a_moment_is_the_thrust_at_the_arm_that_makes_it():
    vehicle = Vehicle(mass_kg=0.05, inertia_kg_m2=(2e-5, 2e-5, 4e-5))
    model = Model(vehicle, {"thrust_pwm": {"c": (0.0, 0.2)}})
    # 0.01 N more on both motors of one side at 32.5 mm: 0.02 N make 6.5e-4 N m, 32.5 rad/s^2 and 0.4 m/s^2
    assert arms(model)[0] * 0.02 * 0.0325 / 2e-5 == pytest.approx(0.02 / 0.05)


def test_a_vehicle_of_another_size_has_the_same_unit():
    """Lengths times 4, masses times 64, inertia times 1024: the same motion in the unit of weight and arm."""
    small = Model(Vehicle(), {"thrust_pwm": {"c": (0.0, 0.2)}})
    vehicle = Vehicle(mass_kg=64 * 0.04085, inertia_kg_m2=tuple(1024 * j for j in Vehicle().inertia_kg_m2),
                      motor_positions_m=tuple((4 * x, 4 * y) for x, y in Vehicle().motor_positions_m))
    # angular accelerations of similar vehicles go with 1 over length
    assert arms(Model(vehicle, {"thrust_pwm": {"c": (0.0, 9.0)}})) / 4 == pytest.approx(arms(small))


def test_random_cosines_have_the_covariance_of_their_process():
    """exp(-d^2 / 2 l^2) of the distance in standard deviations, but for the mean that is taken away."""
    x = np.linspace(-2.0, 2.0, 81)[:, None]
    drawn = [fourier(x, 20, 0.8, np.random.default_rng(k))[:, :40] for k in range(300)]
    found = np.mean([f @ f.T for f in drawn], axis=0)
    z = x / x.std()
    kernel = np.exp(-0.5 * ((z - z.T) / 0.8) ** 2)
    centre = np.eye(81) - 1.0 / 81
    assert np.abs(found - centre @ kernel @ centre).max() < 0.1


@pytest.mark.parametrize(("left_m_s2", "sign", "rejected"), [
    ((0.29, 0.29, 0.29), -1.0, []), ((0.31, 0.31, 0.31), -1.0, []), ((0.34, 0.34, 0.34), -1.0, [0]),
    ((1.0, 1.0, 1.0), -1.0, [0]), ((0.0, 0.0, 9.0), -1.0, []), ((1.0, 1.0, 1.0), 1.0, [])])
def test_a_force_is_identified_only_where_it_outweighs_what_no_effect_explains(left_m_s2, sign, rejected):
    """Pushes of 0.5 and 1.8 m/s^2 along x that change their sign, and a moment, which no force hides: the weaker push
    goes first. One along z cannot imitate it, nor one without a mean a constant push. Numbers are for a force of that
    length, equal along all axes; the fifth along z, the last beside constant pushes."""
    def effect(term: str, push: float, turn: float) -> Effect:
        force, torque = np.zeros((4, 3, 1)), np.zeros((4, 3, 1))
        force[:, 0, 0], torque[:, 1] = push * np.array([1.0, sign, 1.0, sign]), turn
        return Effect(term, force, torque, {}, np.array([-9.0]), np.array([9.0]))

    evidence = SimpleNamespace(P=3, everything=lambda chosen: np.concatenate(
        [np.zeros(3), np.array(left_m_s2) / np.sqrt(3.0), [9.0]]))
    background = Background(np.tile(np.eye(3, 4), (4, 1, 1)), np.zeros((0, 3, 4)),
                            np.array(["place", "air", "late", "tilt"]))
    effects = [effect("wind", 0.5, 0.0), effect("mass", 1.8, 0.0), effect("com_offset", 0.0, 9.0)]
    case = SimpleNamespace(effects=effects, evidence=evidence, background=background, arm=np.full(3, 0.03))
    found = SimpleNamespace(chosen=(0, 1, 2), step=np.ones(3), across=None)
    assert list(decision._overshadowed(case, found)) == rejected


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
    assert decision._alike(case, SimpleNamespace(chosen=(0,), step=np.ones(1)), 0, {"air": left_m_s2}) == alike


def test_a_discrepancy_says_nothing_about_drag():
    """Along every axis its columns have no part that is proportional to the velocity along it, only across it."""
    rng = np.random.default_rng(0)
    air = rng.normal((0.5, 0.0, 0.0), 1.0, (200, 3))
    columns = np.einsum("nk,ij->nijk", fourier(air, 3, 3.0, rng), np.eye(3)).reshape(200, 3, -1)
    found = _beside(air, columns)
    centred = air - air.mean(0)
    assert np.abs(np.einsum("ni,nik->ik", centred, found)).max() < 1e-9
    assert np.abs(centred[:, 0] @ found[:, 1]).max() > 1.0
    curved = columns[:, 0] - centred[:, [0]] * np.linalg.lstsq(centred[:, [0]], columns[:, 0], rcond=None)[0]
    assert found[:, 0] == pytest.approx(curved)


def test_flights_of_one_session_may_share_a_tilt():
    """Of a mean of 0.5 and -3.0 beside usual 0.2 and 1.0, only 0.2 and -1.0 are left; differences stay."""
    offsets = np.array([[0.4, -3.1, 0.0], [0.6, -2.9, 0.0]])
    found = _as_sessions_differ(offsets, np.array([0.2, 1.0, 0.0]))
    assert found == pytest.approx(np.array([[0.1, -1.1, 0.0], [0.3, -0.9, 0.0]]))


@pytest.mark.parametrize("noise", [0.0, 0.5, 1.0])
def test_noisy_commands_lift_a_vehicle_less(noise):
    """Noise of variance s^2 on a fast command of variance 1: the regression has a gain of 1 / (1 + s^2)."""
    rng = np.random.default_rng(0)
    true, shake = rng.normal(size=(2, 20_000))
    measured, made = np.zeros((2, 20_000, 3))
    measured[:, 2], made[:, 2] = true + np.linspace(0.0, 9.0, 20_000), true + noise * shake
    wrench = SimpleNamespace(track=np.zeros(20_000, int), force_at=np.arange(20_000), measured=(measured, measured))
    gain = _lift_gain(wrench, measured - made, np.ones(20_000, bool))
    assert gain == pytest.approx(1.0 / (1.0 + noise**2), abs=0.01)


def test_only_the_common_fast_part_of_commands_is_calmed():
    rng = np.random.default_rng(1)
    track = wrench_of(MODEL, flights=1, seconds=6.0).tracks[0]
    slow = np.linspace(0.5, 0.6, len(track))[:, None]
    differ = 0.01 * rng.normal(size=(len(track), 1)) * [1.0, -1.0, 1.0, -1.0]
    shaken = replace(track, motor=slow + differ + 0.05 * rng.normal(size=(len(track), 1)))
    calm = _calmed(shaken, 0.0).motor
    assert calm - calm.mean(1, keepdims=True) == pytest.approx(differ, abs=1e-12)
    assert calm.mean(1)[100:-100] == pytest.approx(slow[100:-100, 0], abs=0.02)
    assert _calmed(shaken, 1.0).motor == pytest.approx(shaken.motor)


def test_a_trim_turns_with_the_thrust():
    """A centre of mass beside the middle turns the vehicle as the trim of a flight does, row by row."""
    wrench = wrench_of(MODEL, flights=2, seconds=6.0)
    space = within_reach(wrench, space_around(MODEL))
    effects = effects_of(wrench, space, MODEL)
    found = background_of(wrench, space, effects, arms(MODEL), 0)
    moments = next(e.torque for e in effects if e.term == "com_offset")
    trim, com = found.torque[..., found.group == "trim"][:, 0], moments[:, 0, 1]
    first = wrench.flight[wrench.torque_at] == 0
    ratio = trim[first] / com[first, None]
    assert com[first].std() > 0.01 * np.abs(com[first]).mean()
    assert np.abs(ratio[:, 0]).min() > 0.0
    assert ratio.std(0).max() < 1e-9 * np.abs(ratio).max()


@pytest.mark.parametrize(("most", "is_wind"), [(0.0, True), (1.0, False)])
def test_thrust_that_follows_the_lean_is_no_wind(monkeypatch, most, is_wind):
    """0.15 m/s^2 along z with the lean towards x. Without columns for it, a wind and a constant force are taken large
    against each other: equal along x and y, but not along z."""
    monkeypatch.setattr(set_evidence, "CAPS", {**set_evidence.CAPS, "lean": most})
    wrench = wrench_of(MODEL, flights=2, seconds=8.0)
    force, torque = wrench.measured
    lean = so3.matrix(wrench.quaternion[wrench.force_at])[:, 0, 2]
    wrench.__dict__["measured"] = force + 0.15 * (lean / lean.std())[:, None] * [0.0, 0.0, 1.0], torque
    evidence = build(wrench, space_around(MODEL, wrench.unasked), MODEL).evidence
    evidence.learn()
    wind = next(i for i, e in enumerate(evidence.effects) if e.term == "wind")
    assert (evidence.weighed((wind,))[0] > 3.0) == is_wind


@pytest.mark.parametrize("flights", [1, 6, 60])
def test_a_shared_tilt_is_no_more_certain_than_that_of_one_flight(flights):
    case, _, _ = small_case(terms=("wind", "thrust_voltage"))
    case.flights, case.amplitudes = flights, {"tilt": 0.3, "lift": 0.3}
    assert case._shared("wind") == pytest.approx(0.3)
    assert case._shared("thrust_voltage") == pytest.approx(0.15 / np.sqrt(flights))
    assert case._shared("drag_linear") == 0.0


def small_case(seed: int = 0, terms: tuple[str, str] = ("wind", "inflow"), lift_spread: float = 0.0):
    """Two effects and one background column on 30 rows of unit noise; truth: the first effect, 0.8."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(30, 3)) * [1.0, 1.0, 2.0]
    y = 0.8 * columns[:, 0] + 0.3 * columns[:, 2] + rng.normal(size=30)
    values = np.concatenate([columns, y[:, None]], axis=1)
    effects = [Effect(t, np.zeros((1, 3, 1)), np.zeros((0, 3, 1)), {}, np.array([-9.0]), np.array([9.0]))
               for t in terms]
    background = Background(np.zeros((1, 3, 1)), np.zeros((0, 3, 1)), np.array([FIXED]))
    work = np.stack([np.eye(2)] * 6)
    case = Evidence(effects, background, values.T @ values, np.arange(2), np.ones(2), np.full(2, -9.0),
                    np.full(2, 9.0), np.zeros(2), work, np.zeros((6, 2)), np.ones((6, 2)), np.ones(3),
                    gain_error=np.zeros(2), lift_spread=lift_spread)
    case.spike = np.array([0.1, 0.2])
    case._reduce()
    return case, columns, y


def test_evidence_is_that_of_the_normal_distribution(monkeypatch):
    monkeypatch.setattr(set_evidence, "SCALES", (0.5,))
    case, columns, y = small_case()
    beside = columns @ np.diag([0.1**2, 0.2**2, 1.0]) @ columns.T + np.eye(30)
    for chosen in ((0,), (1,), (0, 1)):
        wide = beside + 0.5**2 * columns[:, list(chosen)] @ columns[:, list(chosen)].T
        want = multivariate_normal.logpdf(y, cov=wide) - multivariate_normal.logpdf(y, cov=beside)
        assert case.weighed(chosen)[0] == pytest.approx(want, abs=1e-9)
    # the coefficient is the mean of the conditional distribution
    wide = beside + 0.25 * np.outer(columns[:, 0], columns[:, 0])
    assert case.weighed((0,))[1][0] == pytest.approx(0.25 * columns[:, 0] @ np.linalg.solve(wide, y), abs=1e-9)


@pytest.mark.parametrize("upper", [9.0, 0.4, 0.05, -0.2])
def test_evidence_inside_bounds_is_the_integral_up_to_them(monkeypatch, upper):
    """Also where the flights require a size far outside: no floor makes such an effect probable."""
    monkeypatch.setattr(set_evidence, "SCALES", (0.5,))
    case, _, _ = small_case()
    case.rest = 25.0 * case.rest  # five times as many flights
    case.lower, case.upper = np.full(2, -9.0), np.full(2, upper)
    precise, right = case.rest[0, 0], case.rest[0, -1]
    prior = truncnorm(-18.0, upper / 0.5, scale=0.5)
    at = np.linspace(-2.0, upper, 200_001) if upper < 2.0 else np.linspace(-2.0, 2.0, 200_001)
    log = prior.logpdf(at) + right * at - 0.5 * precise * at**2
    want = logsumexp(log) + np.log(at[1] - at[0])
    assert case.weighed((0,))[0] == pytest.approx(want, abs=2e-2)


@pytest.mark.parametrize("predicted", [0, 10])
def test_two_effects_that_improve_the_same_prediction_are_not_both_identified(monkeypatch, predicted):
    """Each alone improves it by 10 nats, both together by 10, too. A second effect costs 3 nats of evidence.

    So the pair is less probable than either, whether it was predicted or not."""
    monkeypatch.setattr(weighing, "PREDICTED", predicted)
    sets = {(): 0.0, (0,): -3.0, (1,): -3.1, (0, 1): -6.0}
    case = SimpleNamespace(evidence=SimpleNamespace(sets=sets, score=sets.__getitem__),
                           effects=[SimpleNamespace(term=t, far=False) for t in ("wind", "com_offset")])
    monkeypatch.setattr(weighing.Weighing, "sizes", lambda self, chosen: chosen)
    found = weighing.Weighing(case, lambda one, other: 10.0).weigh()
    assert max(found, key=found.get) == (0,)
    assert found[0, 1] == pytest.approx(found[0,] * np.exp(-3.0))


def test_an_effect_far_from_linear_counts_with_the_slopes_where_it_ends():
    """Its secant shows 2 nats, its slopes at the end 15: every set with it gains 13."""
    sets = {(): 0.0, (0,): -1.0, (1,): -3.0, (0, 1): -2.0}
    case = SimpleNamespace(evidence=SimpleNamespace(sets=sets, score=sets.__getitem__, weighed=lambda chosen: (2.0,)),
                           effects=[SimpleNamespace(term=t, far=t == "motor_lag") for t in ("motor_lag", "wind")])
    weighed = weighing.Weighing(case, lambda one, other: 0.0)
    weighed._sizes[(0,)] = SimpleNamespace(log=15.0)
    assert [weighed.evidence(chosen) for chosen in sets] == pytest.approx([0.0, 12.0, -3.0, 11.0])


def test_a_step_that_overshoots_is_shortened():
    """Of x^2 from 1: a step to -3 is worse, half of it ends at the same cost, a quarter at 0; from 0 none is better."""
    def square(x):
        return float(x[0] ** 2)

    assert _shortened(square, np.array([1.0]), np.array([-3.0]), 1.0) == (0.25, 0.0)
    assert _shortened(square, np.array([1.0]), np.array([0.5]), 1.0) == (1.0, 0.25)
    assert _shortened(square, np.array([0.0]), np.array([1.0]), 0.0) == (0.0, 0.0)


@pytest.mark.parametrize(("together", "alike"), [(34.0, {"motor_lag": 0.0}), (22.0, {})])
def test_thrust_that_is_late_as_neither_a_lag_nor_a_delay_is_both(together, alike):
    """Delay 20 nats, lag 17, each with a prior of -4, and both together more or not."""
    logs = {(0,): 20.0, (1,): 17.0, (0, 1): together, (2,): 3.0}
    effects = [SimpleNamespace(term=t) for t in ("command_delay", "motor_lag", "wind")]
    case = SimpleNamespace(effects=effects, evidence=SimpleNamespace(log_prior=lambda chosen: -4.0 * len(chosen)))
    weighed = SimpleNamespace(case=case, sizes=lambda chosen: SimpleNamespace(log=logs[chosen]))
    assert decision._between(weighed, 0) == alike
    assert decision._between(weighed, 2) == {}


def test_an_effect_that_predicts_worse_spoils_every_set_with_it(monkeypatch):
    """The evidence favours the second effect by 8 nats, predictions are 30 against it and 2 for the first. A set of
    both that was not predicted has both."""
    monkeypatch.setattr(weighing, "PREDICTED", 0)
    sets = {(): 0.0, (0,): -3.0, (1,): 8.0, (0, 1): 9.0}
    case = SimpleNamespace(evidence=SimpleNamespace(sets=sets, score=sets.__getitem__),
                           effects=[SimpleNamespace(term=t, far=False) for t in ("command_delay", "force_world")])
    monkeypatch.setattr(weighing.Weighing, "sizes", lambda self, chosen: chosen)
    weighed = weighing.Weighing(case, lambda one, other: {(0,): 2.0, (1,): -30.0}[one])
    found = weighed.weigh()
    assert max(found, key=found.get) == ()
    assert weighed.score((0, 1)) == pytest.approx(9.0 + 2.0 - 30.0)


def test_an_effect_that_only_predictions_speak_for_gives_way(monkeypatch):
    """Predictions favour a wind by 30 nats, a drag by 20, but the residual shows no wind: 0.1 +- 0.5 m/s beside 0."""
    monkeypatch.setattr(weighing, "PREDICTED", 0)
    sets = {(): 0.0, (0,): -3.0, (1,): -3.0, (0, 1): -6.0}
    case = SimpleNamespace(evidence=SimpleNamespace(sets=sets, score=sets.__getitem__),
                           effects=[SimpleNamespace(term=t, far=False) for t in ("wind", "drag_linear")])
    monkeypatch.setattr(weighing.Weighing, "sizes", lambda self, chosen: chosen)
    monkeypatch.setattr(decision, "_inside_bounds", lambda weighed, best: best)
    sizes = decision.Size(0.0, 0.1, 0.5, "m/s"), decision.Size(0.0, 0.015, 0.004, "N s/m")
    monkeypatch.setattr(decision, "_sizes", lambda case, i, found: {"x": sizes[i]})
    monkeypatch.setattr(decision, "_certainty", lambda case, i, found: sizes[i].share)
    weighed = weighing.Weighing(case, lambda one, other: {(0,): 30.0, (1,): 20.0}.get(one, 0.0))
    best, posterior, unsure = decision._certain_of_size(weighed)
    assert best == (1,)
    assert set(posterior) == {(), (1,)}
    assert unsure == {"wind": "the 95 % interval includes the simulator's value: x 0.1 +- 0.5 m/s"}


def test_an_effect_that_gave_way_does_not_come_back_for_one_on_its_bound(monkeypatch):
    """The wind is uncertain; the drag, about as probable, would have to lie on its bound."""
    monkeypatch.setattr(weighing, "PREDICTED", 0)
    sets = {(): 0.0, (0,): 20.0, (1,): 19.0}
    case = SimpleNamespace(evidence=SimpleNamespace(sets=sets, score=sets.__getitem__, allowed=lambda chosen: True),
                           effects=[SimpleNamespace(term=t, far=False) for t in ("wind", "drag_linear")])
    case.evidence.effects = case.effects
    monkeypatch.setattr(weighing.Weighing, "sizes", lambda self, chosen: chosen)
    monkeypatch.setattr(decision, "_on_bound", lambda case, i, found: i == 1)
    monkeypatch.setattr(decision, "_certainty", lambda case, i, found: float(i))
    monkeypatch.setattr(decision, "_uncertain", lambda case, i, found: None if i else "uncertain")
    best, _, unsure = decision._certain_of_size(weighing.Weighing(case, lambda one, other: 0.0))
    assert (best, unsure) == ((1,), {"wind": "uncertain"})


@pytest.mark.parametrize(("part", "certain"), [([2.2, 0.0], False), ([2.6, 0.0], True), ([1.9, 1.9], False)])
def test_several_directions_have_to_leave_their_common_region(part, certain):
    """Two independent directions of unit error: the 95 % region ends at 2.45, the root of 5.99; one alone at 1.96."""
    model = SimpleNamespace(parameters={"a": 0.0, "b": 0.0}, names=("a", "b"), units=("1", "1"))
    case = SimpleNamespace(effects=[SimpleNamespace(width=2, map_share=False, far=False, term="x",
                                                    moves={"a": np.array([1.0, 0.0]), "b": np.array([0.0, 1.0])})],
                           space=SimpleNamespace(model=model), simulator=SimpleNamespace(parameters={}))
    found = SimpleNamespace(chosen=(0,), step=np.array(part), covariance=np.eye(2), model=model)
    assert (decision._certainty(case, 0, found) > 1.0) == certain


@pytest.mark.parametrize(("far", "part", "ratio"), [(True, 0.5, 0.75), (True, 1.0, 1.5), (False, 0.1, np.inf)])
def test_an_effect_far_from_linear_exceeds_what_its_term_may_be_off(far, part, ratio):
    """0.3 m/s^2 a unit; the term may be off by 0.2 m/s^2."""
    evidence = SimpleNamespace(unit=np.array([0.3]), spike=np.array([0.2]), columns=lambda chosen: np.array([0]))
    case = SimpleNamespace(evidence=evidence, effects=[SimpleNamespace(far=far, width=1, term="motor_lag")])
    found = SimpleNamespace(chosen=(0,), step=np.array([part]))
    assert decision._over_error(case, 0, found) == pytest.approx(ratio)


def test_a_wrong_trim_is_no_noise_and_no_gain():
    """A constant moment of 40 rad/s^2 in every flight. The noise of the instruments stays the same, and no term that
    multiplies the moment of the motors has a constant part with which it could hide that."""
    wrench = wrench_of(MODEL, flights=2, seconds=8.0)
    force, torque = wrench.residual(MODEL)
    trim = np.zeros((len(torque), 3, 1))
    trim[:, 0] = 1.0
    nothing = np.zeros((len(force), 3, 1))
    quiet, wrong = (rows_of(wrench, (force, torque + constant * trim[..., 0]), nothing, trim, np.full(1, 50.0))
                    for constant in (0.0, 40.0))
    for one, other in zip(quiet.turnings, wrong.turnings, strict=True):
        assert np.diag(other.spread.sum(0)) == pytest.approx(np.diag(one.spread.sum(0)), rel=0.3)
    lopsided = Model(MODEL.vehicle, {**MODEL.as_dict(), "motor_imbalance": {"g": (0.9, 1.0, 1.1, 1.0)}})
    space = within_reach(wrench, space_around(lopsided))
    means = {e.term: np.abs(e.torque.mean(0)).max() for e in effects_of(wrench, space, lopsided)}
    assert means["inertia"] < 1e-6 < means["com_offset"]


def test_a_column_that_instruments_hardly_see_may_be_wronger():
    """Instruments are the constant and a sine. They see a sine whole, one that shakes with ten times its variance to a
    tenth, and of the discrepancy half."""
    t = np.arange(400) * 0.05
    slow, shake = np.sin(t), np.sqrt(10.0) * np.sign(np.sin(40.0 * t + 0.3))
    torque = np.zeros((400, 3, 2))
    torque[:, 0, 0], torque[:, 0, 1] = slow, slow + shake
    hidden = np.sqrt(0.5) * np.sign(np.sin(37.0 * t))
    unnamed = np.zeros((400, 3, 1))
    unnamed[:, 0, 0] = slow + hidden
    wrench = SimpleNamespace(flight=np.zeros(400, int), torque_at=np.arange(400))
    z = np.stack([np.ones(400), slow], axis=1)
    turning = SimpleNamespace(z=z, at=np.arange(400), axis=0)
    rows = SimpleNamespace(turnings=[turning])
    rows.seen_of = lambda columns: Rows.seen_of(rows, columns)
    background = Background(np.zeros((0, 3, 1)), unnamed, np.array(["turn_air"]))
    seen = _seen(wrench, rows, torque, background)
    assert seen[:3].tolist() == [[1.0, 1.0]] * 3
    assert seen[3, 0] == 1.0
    assert seen[3, 1] == pytest.approx((0.5 / 10.5) / (0.5 / 1.0), rel=0.05)
    assert seen[4:].tolist() == [[1.0, 1.0]] * 2


def test_a_true_effect_is_the_most_probable_and_sets_of_one_family_are_none():
    case, _, _ = small_case()
    case.weigh()
    posterior = case.posterior()
    assert max(posterior, key=posterior.get) == (0,)
    assert sum(posterior.values()) == pytest.approx(1.0)
    terms = [SimpleNamespace(term=t) for t in ("wind", "force_world", "inflow")]
    twins = SimpleNamespace(given_up=set(), effects=terms)
    assert not Evidence.allowed(twins, (0, 1))
    assert Evidence.allowed(twins, (0, 2))


def closed_loop(flights: int = 6, n: int = 700):
    """A command that answers a slow disturbance and shakes between rows, and the moment it makes, three times it, with
    the disturbance; beside them the set-point that the command follows, and the flight of each row."""
    rng = np.random.default_rng(1)
    asked, disturbance = (lfilter([1.0], [1.0, -0.9], rng.normal(size=flights * n)) for _ in range(2))
    command = asked - 0.3 * disturbance + 1.5 * rng.normal(size=flights * n)
    held = asked - 0.3 * disturbance
    return asked, command, 3.0 * held + disturbance + rng.normal(size=flights * n), np.repeat(np.arange(flights), n)


def test_set_points_find_the_gain_that_feedback_and_noisy_inputs_hide():
    asked, command, moment, flight = closed_loop()
    assert command @ moment / (command @ command) < 2.2
    group = _Group.of(np.arange(6), flight, np.arange(len(flight)), asked[:, None])
    turning = group.turning(0, True, np.ones(len(flight)), moment - 3.0 * command)
    columns = np.stack([command, moment], axis=1)[:, None]
    every = np.ones(6, bool)
    whole = turning.asked(turning.of(columns), every)
    assert float(_ridge(whole)[0]) == pytest.approx(3.0, abs=0.2)
    # rows are in standard deviations of the noise: seven of them, a constant for each flight and the set-point
    noise = whole @ [-3.0, 1.0]
    assert noise.shape == (7,)
    assert np.sqrt(np.mean(noise**2)) < 2.5
    # flights left out are as if they had never flown
    keep = np.array([True, False, True, True, False, True])
    mine = keep[flight]
    alone = _Group.of(np.arange(4), np.searchsorted(np.flatnonzero(keep), flight[mine]), np.arange(int(mine.sum())),
                      asked[mine, None]).turning(0, True, np.ones(int(mine.sum())), (moment - 3.0 * command)[mine])
    want = alone.asked(alone.of(columns[mine]), np.ones(4, bool))
    found = turning.asked(turning.of(columns), keep)
    assert found.T @ found == pytest.approx(want.T @ want, rel=0.05)


def test_terms_of_a_family_share_what_flights_show():
    """A set has one of them: their probabilities add up, and the odds between them are what the flights tell."""
    by_term = {"thrust_voltage": 0.54, "thrust_scale": 0.26, "mass": 0.17, "thrust_pwm": 0.02, "wind": 0.9}
    found = decision._of_family("thrust_voltage", by_term)
    assert set(found) == {"thrust_scale", "mass"}
    assert found["mass"] == pytest.approx(np.log(0.54 / 0.17))
    assert set(decision._of_family("mass", by_term)) == {"thrust_scale", "thrust_voltage", "thrust_pwm"}


def test_thrust_may_differ_from_session_to_session_without_being_a_finding():
    for spread in (0.0, 0.2):
        case, _, _ = small_case(terms=("mass", "inflow"), lift_spread=spread)
        case.learn()
        assert case.amplitudes[LIFT_OF_ALL] == pytest.approx(np.hypot(0.01, spread))


@pytest.mark.parametrize(("exponent", "down", "up"), [(2.0, 1.65, 2.6), (2.9, 1.65, 2.91), (1.2, 1.19, 2.6)])
def test_a_thrust_map_keeps_the_exponent_of_a_rotor(exponent, down, up):
    """thrust = t + u + (a - t) u^3 at u = 1 has the exponent (1 + 3 (a - t)) / (1 + a). The present one may stay."""
    a = (exponent - 1.0) / (3.0 - exponent)
    room = Curve(np.array([0.0, 1.0, 0.0, a]), 1.0, (1.65, 2.6)).room(np.array([1.0, 0.0, 0.0, -1.0]))
    assert [(1.0 + 3.0 * (a - t)) / (1.0 + a) for t in room] == pytest.approx([up, down])


def test_the_error_of_a_gain_covers_what_noise_of_the_command_takes_from_it():
    """Least squares against a gain of 1 that is known: its error is within two standard deviations, with noise that
    takes 20 % and 80 % of the gain, and a mean that differs between flights changes nothing."""
    rng, flight = np.random.default_rng(3), np.repeat(np.arange(4), 2000)
    true = rng.normal(size=len(flight))
    for noise in (0.5, 2.0):
        command = true + noise * rng.normal(size=len(flight))
        gain = command @ true / (command @ command)
        error = gain_error(command, true, flight)
        assert 1.0 - gain == pytest.approx(noise**2 / (1.0 + noise**2), abs=0.03)
        assert 1.0 - gain < 2.0 * error < 2.0
        assert gain_error(command + 5.0 * flight, true - 3.0 * flight, flight) == pytest.approx(error)
    assert gain_error(np.zeros(8), np.arange(8.0), np.zeros(8)) == pytest.approx(3.0**-0.5)


def test_columns_of_both_stand_beside_each_other():
    one, other = (Seen(np.full((3, k), float(k)), (np.full((2, 4, k), float(k)),)) for k in (1, 2))
    both = one + other
    assert both.many == 3
    assert both.force[0].tolist() == [1.0, 2.0, 2.0]
    assert both.turning[0][0, 0].tolist() == [1.0, 2.0, 2.0]


@pytest.mark.parametrize(("terms", "kinds"), [
    (("mass",), 1), (("mass", "thrust_scale"), 1), (("drag_linear", "drag_rotor", "com_offset", "motor_imbalance"), 2),
    (("motor_lag", "mass", "rotor_gyro", "thrust_scale"), 3),
    (("saturation", "thrust_voltage", "inertia", "yaw_torque", "drag_torque", "com_offset", "motor_imbalance"), 5)])
def test_terms_of_one_family_and_twins_are_one_kind(terms, kinds):
    """Counted by hand, in any order."""
    assert {decision.kinds_of(order) for order in (terms, terms[::-1], sorted(terms))} == {kinds}


def test_every_group_of_the_discrepancy_has_words():
    assert set(GOES_WITH) == set(set_evidence.MEANS)


def test_rising_and_falling_thrust_each_have_their_lag():
    """Both time constants move together in the first direction, and against each other in the second."""
    model = MODEL.with_parameters({"motor_lag.tau_down_s": 0.08})
    wrench = wrench_of(MODEL, flights=1, seconds=6.0)
    space = within_reach(wrench, space_around(model))
    found = [e for e in effects_of(wrench, space, model) if e.term == "motor_lag"]
    assert [e.width for e in found] == [2, 2, 2]
    none = found[0]
    assert none.moves["motor_lag.tau_up_s"] == pytest.approx([-0.04, -0.02])
    assert none.moves["motor_lag.tau_down_s"] == pytest.approx([-0.08, 0.04])
    without = space.model.with_parameters({"motor_lag.tau_up_s": 0.0, "motor_lag.tau_down_s": 0.0})
    for effect, there, here in zip((none.force, none.torque), wrench.model(without), wrench.model(space.model),
                                   strict=True):
        assert effect[..., 0] == pytest.approx(there - here, abs=1e-9)  # exact where it ends, however it bends


def test_small_commands_may_be_followed_equally_fast_up_and_down():
    """0.02 and 0.08 s: 0.04 s twice, and half the way to 0.02 s. A simulator with one lag needs neither."""
    wrench, model = wrench_of(MODEL, flights=1, seconds=6.0), MODEL.with_parameters(
        {"motor_lag.tau_up_s": 0.02, "motor_lag.tau_down_s": 0.08})
    (mean, _), (short, _) = _equal_lag(wrench, model)
    forty = wrench.model(MODEL)[0]  # MODEL has 0.04 s twice
    twenty = wrench.model(MODEL.with_parameters({"motor_lag.tau_up_s": 0.02, "motor_lag.tau_down_s": 0.02}))[0]
    assert mean == pytest.approx(forty - wrench.model(model)[0])
    assert short == pytest.approx(0.5 * (twenty - forty))
    assert min(np.abs(mean).max(), np.abs(short).max()) > 0.0
    assert _equal_lag(wrench, MODEL) == []


def test_every_effect_that_a_simulator_may_lack_is_asked():
    """A factor of 0 hides what it multiplies, and a limit that nothing reaches has no slope."""
    wrench = wrench_of(MODEL, flights=1, seconds=6.0)
    space = within_reach(wrench, space_around(MODEL))
    found = effects_of(wrench, space, MODEL)
    assert {e.term for e in found} - {"thrust_pwm"} == set(space.terms) - {"thrust_rpm"}
    for effect in found:
        size = np.abs(effect.force).max() + (np.abs(effect.torque).max() if effect.torque.size else 0.0)
        assert size > 0.0, effect.term


@pytest.mark.parametrize(("size", "together"), [(0.0, False), (1e-4, False), (1.0, True)])
def test_set_points_are_instruments_where_they_move(size, together):
    """Rounding of a set-point at rest asks for something too, and says nothing."""
    tracks = wrench_of(MODEL, flights=1, seconds=6.0).tracks
    wave = size * np.sin(6.0 * tracks[0].time_s)[:, None] * [1.0, 1.0]
    wrench = Wrench([replace(t, asked_rad_s2=wave) for t in tracks])
    made, runs = wrench.model(MODEL)[1], runs_of(wrench.torque_at, TORQUE_ROWS, wrench.track)
    assert [instruments(wrench, axis, made, runs)[1] for axis in range(3)] == [together, together, False]

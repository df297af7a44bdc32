"""Evidence of sets of effects against SciPy's distributions."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, truncnorm

from identification.mismatch.page import GOES_WITH
from identification.mismatch.posterior import set_evidence
from identification.mismatch.posterior.background import (
    FIXED,
    LIFT_OF_ALL,
    Background,
)
from identification.mismatch.posterior.effects import Effect
from identification.mismatch.posterior.posterior_engine import STRAINED, WHOLE
from identification.mismatch.posterior.set_evidence import Evidence, _both


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


@pytest.mark.parametrize("flights", [1, 6, 60])
def test_a_shared_tilt_is_no_more_certain_than_that_of_one_flight(flights):
    case, _, _ = small_case(terms=("wind", "thrust_voltage"))
    case.flights, case.amplitudes = flights, {"tilt": 0.3, "lift": 0.3}
    assert case._shared("wind") == pytest.approx(0.3)
    assert case._shared("thrust_voltage") == pytest.approx(0.15 / np.sqrt(flights))
    assert case._shared("drag_linear") == 0.0


def test_a_shared_moment_has_to_exceed_the_scatter_about_its_own_axis():
    """Of the first effect .64 of the work is a roll moment, of the second all is a yaw moment, half of it constant."""
    case, _, _ = small_case()
    case.amplitudes = {"roll_trim": 0.1, "pitch_trim": 9.0, "yaw_trim": 0.6}
    case.varying = np.zeros((6, 2))
    case.varying[5, 1] = 0.5
    share = np.zeros((6, 2))
    share[0, 0], share[3, 0], share[5, 1] = 0.36, 0.64, 1.0
    assert np.sqrt(case._turned(share)) == pytest.approx([0.08, 0.6 * np.sqrt(0.5)])


def test_a_disturbance_has_to_be_imitated_in_force_and_moment_at_once():
    """The size of the first, which pushes alone, is as uncertain as its force. The second pushes and turns: two
    readings of one size, with standard deviations of .5 / .8 and .3 / .6."""
    share = np.array([1.0, 0.64])
    variance = _both(share, np.array([0.25, 0.25 * 0.64]), np.array([0.0, 0.09 * 0.36]))
    assert variance == pytest.approx([0.25, 1.0 / (0.64 / 0.25 + 0.36 / 0.09)])


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


def test_thrust_may_differ_from_session_to_session_without_being_a_finding():
    for spread in (0.0, 0.2):
        case, _, _ = small_case(terms=("mass", "inflow"), lift_spread=spread)
        case.learn()
        assert case.amplitudes[LIFT_OF_ALL] == pytest.approx(np.hypot(0.01, spread))


def test_every_group_of_the_discrepancy_has_words():
    assert set(GOES_WITH) == {*set_evidence.MEANS, STRAINED, WHOLE}

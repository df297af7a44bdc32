"""Summaries over flights: against NumPy and SciPy, reproducible, honest about one flight and few sessions."""

import numpy as np
import pytest
import scipy.stats

from nanobench_tools.metrics.statistics import (
    bootstrap_interval,
    bootstrap_ratio,
    design_effect,
    draws,
    excludes_one,
    intra_class,
    paired_ratio,
    pooled_interval,
    refit_weights,
    summary,
    summary_table,
    weights,
)
from nanobench_tools.results.result import to_json


def test_summary_by_hand():
    found = summary([1.0, 2.0, 3.0, 6.0])
    assert (found.mean, found.median, found.n) == (3.0, 2.5, 4)
    assert found.std == pytest.approx(np.sqrt(3.5))
    assert found.p90 == pytest.approx(5.1)


def test_one_flight_has_no_interval():
    assert to_json(summary([2.0])) == {"mean": 2.0, "std": None, "median": 2.0, "p90": 2.0, "ci95": None, "n": 1,
                                       "sessions": None, "design_effect": None, "intra_class": None,
                                       "ci_why": "one flight"}
    assert "ci_why" not in to_json(summary(np.arange(9.0)))
    assert len(repr(summary(np.random.default_rng(0).normal(size=99), sessions=np.arange(99) // 20))) < 400


def test_undefined_flights_are_left_out_and_counted():
    assert summary([1.0, np.nan, 3.0]).n == 2
    assert summary([np.nan]).mean is None
    with pytest.raises(ValueError, match="infinite"):
        summary([1.0, np.inf])


def test_the_interval_is_scipys():
    x = np.random.default_rng(0).gamma(2.0, size=25)
    ours = bootstrap_interval(x, seed=1, resamples=20000)
    theirs = scipy.stats.bootstrap((x,), np.mean, n_resamples=20000, method="percentile",
                                   rng=np.random.default_rng(2)).confidence_interval
    np.testing.assert_allclose(ours, theirs, rtol=0.02)


def test_the_same_seed_gives_the_same_interval():
    x = np.random.default_rng(0).normal(size=12)
    assert bootstrap_interval(x, 3) == bootstrap_interval(x, 3)
    assert bootstrap_interval(x, 3) != bootstrap_interval(x, 4)


def test_the_interval_covers_the_mean_about_as_often_as_it_says():
    rng = np.random.default_rng(0)
    inside = 0
    for seed in range(400):
        low, high = bootstrap_interval(rng.normal(1.0, 1.0, 30), seed, resamples=500)
        inside += low <= 1.0 <= high
    assert inside / 400 == pytest.approx(0.95, abs=0.04)


def test_one_session_and_stamps_that_are_all_the_same_have_no_interval():
    found = summary([1.0, 2.0, 3.0], sessions=[5, 5, 5])
    assert found.ci95 is None
    assert found.sessions == 1
    assert found.ci_why.startswith("one session")
    assert bootstrap_ratio(np.ones((3, 2)), np.ones(3), sessions=[0, 0, 0]) is None


def test_sessions_that_are_unknown_leave_flights_and_say_so():
    x = np.random.default_rng(0).normal(size=12)
    found = summary(x, sessions=[-1] * 12)
    assert found.ci95 == summary(x).ci95
    assert found.sessions is None
    assert found.ci_why.startswith("sessions unknown")
    assert not summary(x).ci_why
    assert summary(x, sessions=[-1, *range(11)]).sessions is None  # one without a date is enough


def test_fewer_than_five_sessions_are_not_trusted():
    x = np.random.default_rng(0).normal(size=40)
    four, five = (summary(x, sessions=np.arange(40) % k) for k in (4, 5))
    assert four.ci_why == "4 sessions: too narrow to trust"
    assert four.ci95 is not None
    assert not five.ci_why
    assert five.sessions == 5


def test_equal_values_have_no_interval():
    found = summary([2.0] * 10, sessions=np.arange(10))
    assert found.ci95 is None
    assert found.ci_why == "all flights have the same value"
    assert summary([0.1, 0.1, 0.1]).std == 0.0  # no residue of rounding


def test_no_interval_stands_without_reason():
    rng = np.random.default_rng(0)
    for n in range(8):
        for sessions in (None, [-1] * n, [0] * n, np.arange(n), np.arange(n) // 2, [-1, *range(n)][:n]):
            found = summary(rng.normal(size=n), sessions=sessions)
            assert found.ci95 is not None or found.ci_why


def test_flights_may_stand_in_any_order():
    rng = np.random.default_rng(1)
    values, counts, sessions = rng.gamma(2.0, size=(30, 3)), rng.integers(1, 9, 30), rng.integers(0, 6, 30)
    turned = rng.permutation(30)
    for labels in (None, sessions):
        one = pooled_interval(values, counts, labels)
        other = pooled_interval(values[turned], counts[turned], None if labels is None else labels[turned])
        np.testing.assert_allclose(one.low, other.low, rtol=1e-12)
        np.testing.assert_allclose(one.high, other.high, rtol=1e-12)
        assert design_effect(values, labels) == pytest.approx(
            design_effect(values[turned], None if labels is None else labels[turned]))


def test_a_table_gives_what_single_columns_give():
    rng = np.random.default_rng(2)
    values, sessions = rng.normal(size=(20, 4)), np.arange(20) // 4
    values[rng.random((20, 4)) < 0.2] = np.nan
    for k, found in enumerate(summary_table(values, 3, sessions)):
        alone = summary(values[:, k], 3, sessions)
        assert found.ci95 == pytest.approx(alone.ci95, rel=1e-12)
        found, alone = ({k: v for k, v in vars(one).items() if k != "ci95"} for one in (found, alone))
        assert found == pytest.approx(alone)


@pytest.mark.slow
def test_the_two_stages_are_those_of_a_plain_loop():
    sizes, rng = [5, 4, 7, 6], np.random.default_rng(0)
    owner = np.repeat(np.arange(4), sizes)
    x = rng.normal(size=22) + np.array([0.0, 1.0, -1.0, 0.5])[owner]
    means = []
    for _ in range(20000):
        drawn = [rng.choice(x[owner == k], sizes[k]) for k in rng.integers(4, size=4)]
        means.append(np.concatenate(drawn).mean())
    for probability, ends in ((0.95, [2.5, 97.5]), (0.8, [10.0, 90.0])):
        ours = bootstrap_interval(x, 1, probability, 20000, owner)
        np.testing.assert_allclose(ours, np.percentile(means, ends), atol=0.03)


def test_draws_take_whole_sessions_first():
    found = draws((0, 0, 0, 1, 1), 0, 500)
    first, second = found[:, :3].sum(axis=1), found[:, 3:].sum(axis=1)
    assert set(zip(first.tolist(), second.tolist(), strict=True)) == {(6, 0), (3, 2), (0, 4)}


def test_sessions_of_one_flight_are_flights():
    x = np.random.default_rng(0).gamma(2.0, size=12)
    assert summary(x, 0, np.arange(12)[::-1]).ci95 == pytest.approx(summary(x).ci95, rel=0.1)
    assert summary(x, 0, np.arange(12)).design_effect is None  # nothing to compare within


def test_few_flights_get_scipys_bca():
    x = np.array([1.0, 2.0, 4.0, 9.0, 3.0])
    theirs = scipy.stats.bootstrap((x,), np.mean, n_resamples=20000, method="BCa",
                                   rng=np.random.default_rng(0)).confidence_interval
    np.testing.assert_allclose(bootstrap_interval(x, resamples=20000), theirs, rtol=0.03)
    percentile = scipy.stats.bootstrap((x,), np.mean, n_resamples=20000, method="percentile",
                                       rng=np.random.default_rng(0)).confidence_interval
    assert theirs.high > 1.05 * percentile.high  # the case tells them apart


def test_intra_class_correlation_by_hand():
    # sessions (1, 3), (5, 7): means 2 and 6, grand mean 4; MSB = 2 * 4 + 2 * 4 = 16, MSW = 4 / 2 = 2, m0 = 2
    x, sessions = np.array([1.0, 3.0, 5.0, 7.0]), [0, 0, 1, 1]
    assert intra_class(x, sessions) == pytest.approx(14.0 / 18.0)
    assert design_effect(x, sessions) == pytest.approx(1.0 + 14.0 / 18.0)
    # sizes 3, 1: means 2 and 8, grand mean 3.5; MSB = 3 * 2.25 + 20.25 = 27, MSW = 2 / 2, m0 = 4 - 10 / 4 = 1.5
    x, sessions = np.array([1.0, 2.0, 3.0, 8.0]), [7, 7, 7, 2]
    assert intra_class(x, sessions) == pytest.approx(26.0 / 27.5)
    assert design_effect(x, sessions) == pytest.approx(1.0 + 1.5 * 26.0 / 27.5)  # sum of squares 10 / 4 = 2.5


def test_unlike_flights_have_no_negative_correlation():
    assert intra_class(np.array([0.0, 1.0, 0.0, 1.0]), [0, 0, 1, 1]) == 0.0
    assert intra_class(np.ones(4), [0, 0, 1, 1]) == 0.0
    for sessions in (None, [0, 0, 0, 0], [0, 1, 2, 3], [0, 0, 1, -1]):
        assert intra_class(np.arange(4.0), sessions) is None
        assert design_effect(np.arange(4.0), sessions) is None


def nested(sizes, correlation, trials, seed=0):
    """(n, trials) of mean 0 and variance 1 with this intra-class correlation, and the sessions (n,)."""
    owner = np.repeat(np.arange(len(sizes)), sizes)
    rng = np.random.default_rng(seed)
    between = rng.normal(0.0, np.sqrt(correlation), (len(sizes), trials))[owner]
    return between + rng.normal(0.0, np.sqrt(1.0 - correlation), (len(owner), trials)), owner


def covered(sizes, correlation, flat=False):
    values, owner = nested(sizes, correlation, 1000)
    found = pooled_interval(values, np.ones(len(values)), None if flat else owner)
    return np.mean((found.low <= 0.0) & (found.high >= 0.0))


def test_intervals_over_many_sessions_cover_the_mean_as_often_as_they_say():
    for correlation in (0.3, 0.6):
        assert covered([4] * 30, correlation) == pytest.approx(0.95, abs=0.025)
    assert covered([4] * 30, 0.3, flat=True) < 0.88


def test_four_sessions_are_too_few_as_the_rows_say():
    sizes = [18, 4, 26, 20]
    for correlation, share, alone in ((0.14, 0.90, 0.67), (0.3, 0.85, 0.51), (0.6, 0.81, 0.37)):
        assert covered(sizes, correlation) == pytest.approx(share, abs=0.03)
        assert covered(sizes, correlation, flat=True) == pytest.approx(alone, abs=0.04)


def test_the_design_effect_is_what_the_variance_of_the_mean_grows_by():
    sizes, correlation = [18, 4, 26, 20], 0.3
    values, owner = nested(sizes, correlation, 20000)
    expected = 1.0 + (np.sum(np.square(sizes)) / 68 - 1.0) * correlation
    assert np.var(values.mean(axis=0)) * 68 == pytest.approx(expected, rel=0.03)
    many, owner = nested([6] * 300, correlation, 20)
    assert np.mean(design_effect(many, owner)) == pytest.approx(1.0 + 5 * correlation, rel=0.05)


def test_a_paired_ratio_sees_what_two_intervals_hide():
    rng = np.random.default_rng(3)
    theirs = rng.gamma(1.0, size=(40, 1))  # flights differ much more than methods
    ours = 0.9 * theirs * rng.normal(1.0, 0.02, (40, 1))
    found = paired_ratio(ours, theirs, 0, np.arange(40) // 4)[0]
    assert found.ratio == pytest.approx(0.9, abs=0.02)
    assert excludes_one(found.ci95)
    assert found.n == 40
    apart = [summary(x[:, 0], 0, np.arange(40) // 4).ci95 for x in (ours, theirs)]
    assert apart[0][1] > apart[1][0]  # the two rows overlap
    assert paired_ratio(theirs, ours, 0)[0].ratio == pytest.approx(1.0 / found.ratio)


def test_a_paired_ratio_takes_the_flights_that_both_have():
    ours, theirs = np.array([[1.0, 1.0], [np.nan, 2.0], [3.0, 5.0]]), np.array([[2.0, 2.0], [2.0, 2.0], [6.0, np.nan]])
    first, second = paired_ratio(ours, theirs)
    assert (first.ratio, first.n) == (0.5, 2)
    assert (second.ratio, second.n) == (0.75, 2)
    assert paired_ratio(ours[:1], theirs[:1])[0].ci_why == "one flight"
    none = paired_ratio(np.zeros((5, 1)), np.zeros((5, 1)))[0]
    assert none.ratio is None
    assert none.ci95 is None
    assert none.ci_why
    same = paired_ratio(np.arange(1.0, 9.0)[:, None], np.arange(1.0, 9.0)[:, None])[0]
    assert same.ratio == 1.0
    assert same.ci95 is None
    assert not excludes_one(same.ci95)


def test_a_difference_is_one_when_the_interval_excludes_one():
    assert excludes_one([0.8, 0.99])
    assert excludes_one([1.01, 1.2])
    assert not excludes_one([0.9, 1.1])
    assert not excludes_one(None)


def test_weights_of_refits_draw_sessions_and_fall_back_to_flights():
    nested = refit_weights(6, [0, 0, 0, 1, 1, 1], 3, 500)
    assert np.array_equal(nested, weights(6, [0, 0, 0, 1, 1, 1], 3, 500))
    assert np.ptp(nested[:, :3].sum(axis=1)) == 6.0  # a session is drawn twice, or not at all
    assert np.all(nested.sum(axis=1) == 6.0)
    assert weights(6, np.zeros(6), 3, 500) is None
    assert np.array_equal(refit_weights(6, np.zeros(6), 3, 500), weights(6, None, 3, 500))


@pytest.mark.parametrize("n", [3, 4, 7])
def test_intervals_of_few_flights_do_not_hang_on_rounding(n):
    """Draws of every flight once are the estimate itself; BCa counts how many draws lie below it."""
    x = np.random.default_rng(n).normal(1.0, 0.4, n)
    plain = bootstrap_interval(x, sessions=range(n))
    for seed in range(20):
        moved = x * (1.0 + 1e-15 * np.random.default_rng(seed).normal(size=n))
        assert bootstrap_interval(moved, sessions=range(n)) == pytest.approx(plain, rel=1e-6)

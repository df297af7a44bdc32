"""Sets weighed by evidence and by what they predict."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from identification.mismatch.posterior import weighing


@pytest.mark.parametrize("predicted", [0, 10])
def test_two_effects_that_improve_the_same_prediction_are_not_both_identified(monkeypatch, predicted):
    """Each alone improves it by 10 nats, both together by 10, too. A second effect costs 3 nats of evidence.

    So the pair is less probable than either, whether it was predicted or not."""
    monkeypatch.setattr(weighing, "PREDICTED", predicted)
    sets = {(): 0.0, (0,): -3.0, (1,): -3.1, (0, 1): -6.0}
    case = SimpleNamespace(evidence=SimpleNamespace(sets=sets, any_opposed=lambda s: False, score=sets.__getitem__),
                           effects=[SimpleNamespace(term=t, far=False) for t in ("wind", "com_offset")])
    monkeypatch.setattr(weighing.Weighing, "sizes", lambda self, chosen: chosen)
    found = weighing.Weighing(case, lambda one, other: 10.0).weigh()
    assert max(found, key=found.get) == (0,)
    assert found[0, 1] == pytest.approx(found[0,] * np.exp(-3.0))


def test_an_effect_far_from_linear_counts_with_the_slopes_where_it_ends():
    """Its secant shows 2 nats, its slopes at the end 15: every set with it gains 13."""
    sets = {(): 0.0, (0,): -1.0, (1,): -3.0, (0, 1): -2.0}
    evidence = SimpleNamespace(sets=sets, score=sets.__getitem__, weighed=lambda chosen: (2.0,))
    case = SimpleNamespace(evidence=evidence,
                           effects=[SimpleNamespace(term=t, far=t == "motor_lag") for t in ("motor_lag", "wind")])
    weighed = weighing.Weighing(case, lambda one, other: 0.0)
    weighed._sizes[(0,)] = SimpleNamespace(log=15.0)
    assert [weighed.evidence(chosen) for chosen in sets] == pytest.approx([0.0, 12.0, -3.0, 11.0])


def test_an_effect_that_predicts_worse_spoils_every_set_with_it(monkeypatch):
    """The evidence favours the second effect by 8 nats, predictions are 30 against it and 2 for the first. A set of
    both that was not predicted has both."""
    monkeypatch.setattr(weighing, "PREDICTED", 0)
    sets = {(): 0.0, (0,): -3.0, (1,): 8.0, (0, 1): 9.0}
    case = SimpleNamespace(evidence=SimpleNamespace(sets=sets, any_opposed=lambda s: False, score=sets.__getitem__),
                           effects=[SimpleNamespace(term=t, far=False) for t in ("command_delay", "force_world")])
    monkeypatch.setattr(weighing.Weighing, "sizes", lambda self, chosen: chosen)
    weighed = weighing.Weighing(case, lambda one, other: {(0,): 2.0, (1,): -30.0}[one])
    found = weighed.weigh()
    assert max(found, key=found.get) == ()
    assert weighed.score((0, 1)) == pytest.approx(9.0 + 2.0 - 30.0)


@pytest.mark.parametrize("predicted", [0, 10])
def test_sets_that_errors_of_terms_cancel_have_no_probability(monkeypatch, predicted):
    """The pair is the most probable set; its two forces exist only against the error of a third term."""
    monkeypatch.setattr(weighing, "PREDICTED", predicted)
    sets = {(): 0.0, (0,): 4.0, (1,): -3.0, (0, 1): 50.0}
    evidence = SimpleNamespace(sets=sets, score=sets.__getitem__, any_opposed=lambda s: len(s) > 1)
    case = SimpleNamespace(evidence=evidence,
                           effects=[SimpleNamespace(term=t, far=False) for t in ("com_offset", "force_world")])
    monkeypatch.setattr(weighing.Weighing, "sizes", lambda self, chosen: chosen)
    found = weighing.Weighing(case, lambda one, other: 0.0).weigh()
    assert found == pytest.approx({(): 0.018, (0,): 0.981, (1,): 0.0009}, rel=0.01)

"""Refitted to predictions: the truth comes back from flights that a model flew; what is no better is left."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from carried_tracks import HOVER_V, MODEL

from identification.mismatch.decide import Decision
from identification.mismatch.fitting import Slopes, fit
from identification.mismatch.moments import moments_of
from identification.mismatch.proof import prove
from identification.mismatch.refit import refit
from identification.mismatch.space import space_around
from identification.mismatch.track import ROW_S, Track
from identification.mismatch.wrench import Wrench
from nanobench_tools.physics.rollout import rollout

SCALE = 1.04


def climb(flight: int) -> Track:
    """Up and down with all motors alike, thrust SCALE times what MODEL says; an open loop that does not lean."""
    rng, n = np.random.default_rng(flight), 1000
    t = ROW_S * np.arange(n)
    waves = np.sin(2.0 * np.pi * rng.uniform(0.5, 2.0, 4) * t[:, None] + rng.uniform(0.0, 6.0, 4)).sum(axis=1)
    battery = np.linspace(4.0, 3.6, n)
    motor = np.repeat((HOVER_V / np.sqrt(SCALE) * (1.0 + 0.03 * waves) / battery)[:, None], 4, axis=1)
    start = np.array([0.0, 0.0, 20.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    true = MODEL.with_term("thrust_scale", s=SCALE)
    states = rollout(true, start[None], motor[None], battery[None], (motor[None, :50], battery[None, :50]))[0, :n]
    counts = np.zeros(n, bool)
    counts[60:-20] = True
    noise = 1e-5 * rng.standard_normal((n, 3))
    rate = states[:, 10:13] + 1e-3 * rng.standard_normal((n, 3))
    return Track(f"flight_{flight + 1}", flight, t, states[:, 0:3] + noise, states[:, 3:6] + 2e3 * noise,
                 states[:, 6:10], rate, np.full((n, 3), np.nan), motor, battery, counts, t, np.zeros((n, 2)))


@pytest.fixture(scope="module")
def named():
    """(moments, decision whose scale is found along the measured states, proof)."""
    wrench, space = Wrench([climb(k) for k in range(3)]), space_around(MODEL)
    free = space.free("thrust_scale")
    moments = moments_of(wrench, wrench.residual(MODEL), np.zeros((len(wrench.force_at), 3, 0)), [])
    known = Slopes(moments)
    found = fit(known, space.model, free)
    finding = SimpleNamespace(hypothesis=SimpleNamespace(term="thrust_scale"), axes=("force z",))
    decision = Decision("named", (finding,), (), (), found, space, (), (), np.zeros(6), np.zeros(6), {})
    return moments, decision, prove(moments, decision, MODEL)


def test_a_fit_that_is_right_stays(named):
    again = refit(*named)
    assert again.fitted["thrust_scale.s"] == pytest.approx(SCALE, abs=1e-3)
    assert again.refitted["thrust_scale.s"] == pytest.approx(SCALE, abs=1e-3)
    assert not again.taken
    assert "not taken" in again.sentence
    body = again.to_json()
    assert body["held_out"]["50"]["refitted"]["position_m"] == pytest.approx(
        body["held_out"]["50"]["fitted"]["position_m"], rel=0.1)


def test_one_that_is_wrong_is_set_right_and_taken(named):
    moments, decision, proof = named
    wrong = decision.fit.model.with_parameters({"thrust_scale.s": 1.01})
    decision = replace(decision, fit=replace(decision.fit, model=wrong))
    worse = replace(proof, after=proof.before)
    again = refit(moments, decision, worse)
    assert again.refitted["thrust_scale.s"] == pytest.approx(SCALE, abs=1e-3)
    assert again.taken
    assert again.model.parameters["thrust_scale.s"] == pytest.approx(SCALE, abs=1e-3)
    assert again.to_json()["parameters"]["thrust_scale.s"]["fitted"] == 1.01


def test_what_cannot_be_judged_is_not_refitted(named):
    moments, decision, proof = named
    assert "no effect was identified" in refit(moments, replace(decision, findings=()), proof)
    assert "one flight alone" in refit(moments, decision, replace(proof, held_out=False))
    assert "per-flight value" in refit(moments, replace(decision, own=("mass",)), proof)

"""How the evidence is built from a wrench: columns for the lean, and what instruments see of a column."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from carried_tracks import MODEL, wrench_of

from identification.mismatch.posterior import background, set_evidence
from identification.mismatch.posterior.background import (
    Background,
)
from identification.mismatch.posterior.build import _seen, build
from identification.mismatch.posterior.rows import Rows
from identification.mismatch.space import space_around
from nanobench_tools import so3


@pytest.mark.parametrize(("most", "is_wind"), [(0.0, True), (1.0, False)])
def test_thrust_that_follows_the_lean_is_no_wind(monkeypatch, most, is_wind):
    """0.6 m/s^2 along z with the lean towards x. Without columns for it, a wind and a constant force are taken large
    against each other: equal along x and y, but not along z. The tracked point is the centre of mass here."""
    monkeypatch.setattr(background, "TRACKED", 1e-6)
    monkeypatch.setattr(set_evidence, "CAPS", {**set_evidence.CAPS, "lean": most})
    wrench = wrench_of(MODEL, flights=2, seconds=8.0)
    force, torque = wrench.measured
    lean = so3.matrix(wrench.quaternion[wrench.force_at])[:, 0, 2]
    wrench.__dict__["measured"] = force + 0.6 * (lean / lean.std())[:, None] * [0.0, 0.0, 1.0], torque
    evidence = build(wrench, space_around(MODEL, wrench.unasked), MODEL).evidence
    evidence.learn()
    wind = next(i for i, e in enumerate(evidence.effects) if e.term == "wind")
    assert (evidence.weighed((wind,))[0] > 3.0) == is_wind
    assert evidence.any_opposed((wind,))


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
    others = Background(np.zeros((0, 3, 1)), unnamed, np.array(["turn_air"]))
    seen = _seen(wrench, rows, torque, others)
    assert seen[:3].tolist() == [[1.0, 1.0]] * 3
    assert seen[3, 0] == 1.0
    assert seen[3, 1] == pytest.approx((0.5 / 10.5) / (0.5 / 1.0), rel=0.05)
    assert seen[4:].tolist() == [[1.0, 1.0]] * 2

"""What no effect explains: forces along errors that would have to be larger than a small error is, and all groups
together."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from identification.mismatch.posterior import certainty
from identification.mismatch.posterior import strained as module
from identification.mismatch.posterior.background import FIXED, Background, rms
from identification.mismatch.posterior.strained import strained


@pytest.mark.parametrize(("coefficients", "given_up", "expected"), [
    ((0.2, 0.2, 2.0, 9.0), (), 0.0),  # within three standard deviations, and a group with an amplitude of its own
    ((0.2, 0.2, -4.0, 9.0), (), 4.0),  # an artefact of logging
    ((0.2, 0.2, 2.0, 9.0), ("mass",), 0.2),  # a term that cannot be what it looks like
    ((0.2, 0.2, -4.0, 9.0), ("mass",), 3.8),
    ((0.4, 0.2, -4.0, 9.0), ("mass", "wind"), np.hypot(0.4, 3.8))])
def test_errors_of_logging_count_beyond_three_standard_deviations(monkeypatch, coefficients, given_up, expected):
    """A wind along x, and a mass and an artefact along z, each of 1 m/s^2 per unit."""
    def along(axis):
        return np.tile(np.eye(3)[axis], (5, 1))[..., None]

    effects = [SimpleNamespace(term=t, force=along(axis), torque=2.0 * along(axis))
               for t, axis in (("wind", 0), ("mass", 2))]
    evidence = SimpleNamespace(P=2, unit=np.ones(2), columns=list, given_up=set(given_up))
    case = SimpleNamespace(
        effects=effects, evidence=evidence, wrench=SimpleNamespace(force_at=np.arange(5)),
        background=Background(np.concatenate([along(2), along(1)], 2), np.zeros((5, 3, 2)), np.array([FIXED, "place"])))
    monkeypatch.setattr(module, "nuisance", lambda case, found: np.array(coefficients))
    force, torque = strained(case, SimpleNamespace(chosen=()))
    assert rms(force) == pytest.approx(expected)
    assert np.abs(torque[:, 0] - 2.0 * force[:, 0]).max() == 0.0


def test_groups_that_oppose_each_other_leave_what_is_left_of_both(monkeypatch):
    """Forces of the place and of time, 3 and -2.5 along the same wave: each is large, and 0.5 m/s^2 is there. The
    third is constant in either flight, so it is an offset; moments of 4 and 3 about different axes make 5."""
    wave = np.tile([1.0, -1.0], 4)
    flight = np.repeat([0, 1], 4)
    force, torque = np.zeros((8, 3, 5)), np.zeros((8, 3, 5))
    force[:, 2, 0], force[:, 2, 1], force[:, 0, 2] = wave, wave, 1.0 + flight
    torque[:, 0, 3], torque[:, 1, 4] = wave / 0.5, wave / 2.0
    groups = np.array(["place", "time", "late", "turn_place", "turn_air"])
    case = SimpleNamespace(evidence=SimpleNamespace(P=1), arm=np.array([0.5, 2.0, 1.0]),
                           background=Background(force, torque, groups),
                           wrench=SimpleNamespace(flight=flight, force_at=np.arange(8), torque_at=np.arange(8)))
    monkeypatch.setattr(certainty, "nuisance", lambda case, found: np.array([9.0, 3.0, -2.5, 7.0, 4.0, 3.0]))
    assert certainty.unnamed(case, None) == pytest.approx((0.5, 5.0))

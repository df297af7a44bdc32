"""A mass is there at any speed; a force that goes with the speed only looks like one."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from identification.mismatch.posterior import in_motion

RNG = np.random.default_rng(5)
SPEED = RNG.uniform(0.0, 2.0, 400)
COLUMN = -9.81 - RNG.normal(size=400)


class Seen(SimpleNamespace):
    """Columns of one flight."""

    def __add__(self, other):
        return Seen(force=(np.column_stack([self.force[0], other.force[0]]),))


def said(monkeypatch, force, resting=0.0, hides=None):
    """What the residual ``force`` (400,) along z says, in noise of one. A speed below ``resting`` was never flown.
    ``hides``: the background takes all that goes with the speed."""
    flown = resting <= SPEED
    column, left = COLUMN[flown], force[flown]
    size = float(column @ left / (column @ column))
    wrench = SimpleNamespace(
        force_at="force", torque_at="torque",
        of=lambda name, at: np.outer(SPEED[flown] if at == "force" else np.zeros(0), [0.6, 0.0, 0.8]))
    effect = SimpleNamespace(width=1, force=np.stack([0.0 * column, 0.0 * column, column], 1)[..., None],
                             torque=np.zeros((0, 3, 1)))
    case = SimpleNamespace(
        wrench=wrench, effects=[effect], evidence=SimpleNamespace(unit=np.array([2.0]), columns=lambda chosen: [0]),
        rows=SimpleNamespace(of=lambda force, torque: Seen(force=(force[:, 2],))),
        across=lambda seen: seen.force[0], beside=lambda x, chosen: x.T @ x if hides is None else np.eye(3))
    monkeypatch.setattr(in_motion, "slopes", lambda case, chosen, step, unit: Seen(force=(
        np.column_stack([column / unit[0], left - column * step[0]]),)))
    found = SimpleNamespace(chosen=(0,), step=np.array([size]), slab=np.array([3.0]))
    return in_motion.only_in_motion(case, found, 0)


@pytest.mark.parametrize(("by_speed", "moving"), [(lambda s: np.ones_like(s), False), (lambda s: s, True),
                                                  (lambda s: s**2, True), (lambda s: 1.0 + 0.3 * s, False)])
def test_a_force_that_is_gone_at_rest_is_no_mass(monkeypatch, by_speed, moving):
    force = 0.1 * COLUMN * by_speed(SPEED) + RNG.normal(size=400)
    assert said(monkeypatch, force) == moving


@pytest.mark.parametrize(("by_speed", "moving"), [(lambda s: np.ones_like(s), False), (lambda s: s, True)])
def test_what_the_background_takes_is_seen_between_slow_and_fast(monkeypatch, by_speed, moving):
    assert said(monkeypatch, 0.1 * COLUMN * by_speed(SPEED) + RNG.normal(size=400), hides=True) == moving


def test_flights_that_never_rest_show_nothing(monkeypatch):
    """Between 1.9 and 2 m/s a mass and a force that grows with the speed differ by less than the noise."""
    assert not said(monkeypatch, 0.1 * COLUMN * SPEED + RNG.normal(size=400), resting=1.9)


def test_an_effect_of_size_zero_does_not_depend_on_the_speed(monkeypatch):
    assert said(monkeypatch, np.zeros(400)) is False

"""What set-points ask for, as an instrument for torques."""

from __future__ import annotations

import numpy as np
import pytest

from identification.mismatch.track import MOST_ASKED_RAD_S2, _asked
from nanobench_tools.flight import Flight, Provenance, make_stream

TIME_S = np.arange(100, 900) * 0.01


def flight(position: np.ndarray, time_s: np.ndarray) -> Flight:
    stream = make_stream("setpoint", time_s, position, ("x", "y"))
    return Flight("f", {"setpoint": stream}, {}, Provenance(path="f", sha256="0", source="test", synthetic=True))


def test_a_swing_asks_for_its_fourth_derivative_over_g():
    """x = A sin(w t): d4x/dt4 = A w^4 sin(w t); a Gaussian of 60 ms takes exp(-(w s)^2 / 2) of it."""
    time_s = np.arange(0, 1000) * 0.01
    w = 2.0 * np.pi * 0.6
    path = np.stack([0.5 * np.sin(w * time_s), np.zeros_like(time_s)], axis=1)
    asked = _asked(flight(path, time_s), TIME_S)
    expected = 0.5 * w**4 / 9.81 * np.exp(-0.5 * (w * 0.06) ** 2) * np.sin(w * TIME_S)
    assert asked[:, 0] == pytest.approx(expected, abs=0.02 * np.abs(expected).max())
    assert asked[:, 1] == pytest.approx(0.0, abs=1e-9)


def test_a_jump_is_not_followed():
    time_s = np.arange(0, 1000) * 0.01
    path = np.stack([np.where(time_s > 5.0, 1.0, 0.0), np.zeros_like(time_s)], axis=1)
    assert np.abs(_asked(flight(path, time_s), TIME_S)).max() <= MOST_ASKED_RAD_S2


def test_without_set_points_nothing_is_asked():
    empty = Flight("f", {}, {}, Provenance(path="f", sha256="0", source="test", synthetic=True))
    assert not _asked(empty, TIME_S).any()

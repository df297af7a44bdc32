"""A force without a name that other flights know, and one that they cannot know."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from carried_tracks import MODEL, track_of

from identification.mismatch.posterior import repeats
from identification.mismatch.posterior.build import build
from identification.mismatch.posterior.repeats import Repeat, _slow, repeat_of
from identification.mismatch.posterior.sizing import refine
from identification.mismatch.space import space_around
from identification.mismatch.wrench import Wrench


def by_place(position, t):
    return 0.8 * np.array([np.sin(2.0 * position[2]), 0.0, 0.0])


def by_time(flight):
    return lambda position, t: 0.6 * np.sin(2.0 * np.pi * 0.4 * t + 2.4 * flight) * np.array([1.0, 0.0, 0.5])


@pytest.mark.parametrize(("push", "repeated"), [(lambda flight: by_place, True),
                                                pytest.param(by_time, False, marks=pytest.mark.slow)])
def test_a_force_of_the_place_repeats_and_one_of_time_alone_does_not(push, repeated):
    """0.8 m/s^2 at most, so 0.4 to 0.6 RMS: an error of 5 to 7 cm after half a second."""
    wrench = Wrench([track_of(MODEL, 30 + k, k, seconds=8.0, push=push(k)) for k in range(4)])
    case = build(wrench, space_around(MODEL, wrench.unasked), MODEL)
    case.evidence.learn()
    found = repeat_of(case, refine(case, ()))
    assert found.matters(0.05) == repeated
    if repeated:
        assert found.group == "place"
        assert 0.2 < found.size_m_s2 < 0.8  # a flight that was left out knows less
    else:
        assert found.share < 0.05


def test_one_flight_repeats_nothing():
    found = repeat_of(SimpleNamespace(flights=np.array([0]), background=None), None)
    assert (found.share, found.rises(0.03)) == (0.0, 0.0)
    assert not found.matters(0.03)


def test_a_force_matters_when_the_path_is_a_quarter_worse_without_it():
    """0.12 m/s^2 move 1.5 cm in half a second. With 2 cm from something else, that makes 2.5 cm."""
    force = Repeat(0.3, 0.12, "place", 0.12)
    assert force.rises(0.025) == pytest.approx(0.25)
    assert force.matters(0.0249)
    assert not force.matters(0.0251)
    assert force.matters(0.014)  # all of it
    assert not Repeat(-0.1, 0.12, "place", 0.12).matters(0.02)


def test_the_slow_force_is_that_of_half_a_second_without_its_mean():
    """A force that changes sign every half second is as large as its mean over windows; a quick one leaves little, and
    a constant one nothing."""
    t = np.arange(2000) * repeats.SAMPLE_S
    zero = np.zeros((len(t), 2))
    slow, quick = (np.column_stack([np.sin(2.0 * np.pi * hertz * t), zero]) for hertz in (0.1, 8.0))
    track = np.zeros(len(t), int)
    assert _slow(slow + 3.0, track) == pytest.approx(0.5**0.5, rel=0.03)
    assert _slow(quick + 3.0, track) < 0.06

"""The smallest size that is said to be named: effects above it are, effects well below it are not."""

from __future__ import annotations

import numpy as np
import pytest
from carried_tracks import MODEL, wrench_of

from identification.mismatch.decide import Decision
from identification.mismatch.diagnosis import _named
from identification.mismatch.space import space_around
from identification.mismatch.verdict import power
from identification.mismatch.wrench import Wrench


@pytest.fixture(scope="module")
def quiet():
    """(wrench, power) of flights without a mismatch."""
    wrench, space = wrench_of(MODEL, flights=2, seconds=8.0), space_around(MODEL)
    moments, named = _named(wrench, space, MODEL, lambda text: None)
    decision = Decision("none", (), (), (), named.fit, space, (), (), np.zeros(6), np.zeros(6), {})
    return wrench, power(moments, decision)


def named_at(wrench: Wrench, term: str, parameter: str, size: float) -> bool:
    """Whether a change of this size, in what these flights measured, is named."""
    name, _, element = parameter.partition("[")
    values = [0.0, 0.0, 0.0]
    values[int(element[:-1])] = size
    changed = MODEL.with_term(term, **{name.rpartition(".")[2]: tuple(values)})
    moved = Wrench(wrench.tracks)
    moved.measured = tuple(m + b - a for m, a, b in zip(wrench.measured, wrench.model(MODEL), wrench.model(changed),
                                                        strict=True))
    found = _named(moved, space_around(MODEL), MODEL, lambda text: None)[1]
    return term in {t for h, also in zip(found.accepted, found.alike, strict=True) for t in (h.term, *also)}


@pytest.mark.slow
def test_sizes_above_are_named_and_sizes_below_are_not(quiet):
    wrench, told = quiet
    least, parameter = told["com_offset"]["minimum_detectable"], told["com_offset"]["parameter"]
    assert named_at(wrench, "com_offset", parameter, 1.4 * least)
    assert not named_at(wrench, "com_offset", parameter, 0.4 * least)


def test_a_delay_is_looked_for_as_it_acts(quiet):
    assert 0.006 < quiet[1]["command_delay"]["minimum_detectable"] < 0.05

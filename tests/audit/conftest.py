"""Practice flights flown once for all tests of this folder, and their audits."""

from __future__ import annotations

import pytest

from nanobench_tools.audit import audit
from nanobench_tools.practice import fly, path_spec, practice_flights
from nanobench_tools.practice.flights import _recording
from nanobench_tools.practice.onboard import OnboardFleet


@pytest.fixture(scope="session")
def flights():
    """All families at three speeds, 15 s of path each, about a third behind the Mellinger controller."""
    return practice_flights(30, seed=21, duration_s=15.0)


@pytest.fixture(scope="session")
def audits(flights):
    return [audit(flight) for flight in flights]


@pytest.fixture(scope="session")
def recorded():
    """The same flight, a fast trefoil of 12 s, through any logging chain."""
    spec = path_spec("trefoil", "fast", duration_s=12.0)
    flown = fly(OnboardFleet(("pid",)), [spec], seed=3, indices=(0,))
    return lambda chain: _recording(flown, 0, 0, spec, "pid", 3, chain)

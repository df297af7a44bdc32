"""Practice flights flown once for all tests of this folder, and their audits."""

from __future__ import annotations

import pytest

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.practice import practice_flights


@pytest.fixture(scope="session")
def flights(made_once):
    """All families at three speeds, 15 s of path each, about a third behind the Mellinger controller."""
    return made_once("audit_flights", lambda: practice_flights(30, seed=21, duration_s=15.0))


@pytest.fixture(scope="session")
def audits(flights, made_once):
    return made_once("audit_audits", lambda: [audit(flight) for flight in flights])


@pytest.fixture(scope="session")
def recorded(crowd):
    """The same flight, a fast trefoil of 14 s, through any logging chain."""
    return lambda chain: crowd.flight("fast trefoil", chain)

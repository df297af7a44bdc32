"""Practice flights flown once for all tests of this folder, and their audits."""

import pytest

from nanobench_tools.auditing.recording_audit import Audit, audit
from nanobench_tools.practice import practice_flights


@pytest.fixture(scope="session")
def flights(made_once):
    """All families at three speeds, 15 s of path each, about a third behind the Mellinger controller."""
    return made_once("audit_flights", lambda: practice_flights(30, seed=21, duration_s=15.0))


class Audits:
    """Audits of ``flights`` by number, each made once in a run and when it is first needed."""

    def __init__(self, flights, made_once) -> None:
        self.flights, self.made_once = flights, made_once

    def __getitem__(self, number: int) -> Audit:
        return self.made_once(f"audit_of_{number}", lambda: audit(self.flights[number]))


@pytest.fixture(scope="session")
def audits(flights, made_once):
    return Audits(flights, made_once)


@pytest.fixture(scope="session", params=["8", pytest.param("30", marks=pytest.mark.slow)])
def audited_flights(request, flights, audits):
    """(flight, audit) of every fourth, which takes in all speeds and both controllers, or of all."""
    return [(flights[i], audits[i]) for i in range(0, len(flights), 4 if request.param == "8" else 1)]


@pytest.fixture(scope="session")
def recorded(crowd):
    """The same flight, a fast trefoil of 14 s, through any logging chain."""
    return lambda chain: crowd.flight("fast trefoil", chain)

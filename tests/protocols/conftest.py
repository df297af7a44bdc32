"""Real recordings with audits made when asked for."""

import functools
from collections.abc import Mapping

import pytest

from nanobench_tools.auditing.recording_audit import Audit
from nanobench_tools.sources.discover import load_recordings


class Audits(Mapping):
    """Audits by name of the flight, made when first asked for: a test pays only for the flights it uses."""

    def __init__(self, audited, flights) -> None:
        self.audited = audited
        self.flights = {flight.name: flight for flight in flights}
        self.known: dict[str, Audit] = {}

    def __getitem__(self, name: str) -> Audit:
        if name not in self.known:
            self.known[name] = self.audited(self.flights[name])
        return self.known[name]

    def __iter__(self):
        return iter(self.flights)

    def __len__(self) -> int:
        return len(self.flights)

    def __contains__(self, name) -> bool:
        return name in self.flights


@pytest.fixture(scope="session")
def real(real_data, audits_of):
    """(flights, audits) of all real NanoBench recordings."""
    flights = load_recordings([real_data / "nanobench"]).flights
    return flights, audits_of(flights)


@pytest.fixture(scope="session")
def audits_of(audited):
    """flights -> their audits, made when asked for."""
    return functools.partial(Audits, audited)

"""Flights of a case, kept on disk between its making and its diagnosis: RotorPy takes half a minute for one case.

Keeps the exact input of a diagnosis (Parquet and simulator.toml) and the seal of the truth, never the truth itself.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight
from nanobench_tools.harness import item_key, read_json, write_json
from nanobench_tools.physics import Model
from nanobench_tools.physics.simulator import read_simulator, write_simulator
from nanobench_tools.sources.cache import fetch, store

from .case_kinds import CaseSpec
from .make import Case
from .seal import seal

SCHEMA, SEAL, SIMULATOR = "prove-flown", "seal.json", "simulator.toml"


@dataclass(frozen=True)
class Given:
    """What a diagnosis is given, and the seal of the truth behind it."""

    flights: list[Flight]
    simulator: Model
    truth: str


def given(case: Case) -> Given:
    return Given(case.flights, case.simulator, seal([case.truth]))


def keep(case: Case, folder: Path) -> None:
    """A folder that cannot be written only costs the time of flying again."""
    place = _place(case.spec, folder)
    try:
        place.mkdir(parents=True, exist_ok=True)
        for flight in case.flights:
            store(place / f"{flight.name}.parquet", flight)
        write_simulator(case.simulator, place / SIMULATOR)
        write_json(place / SEAL, {"schema": f"nanobench-{SCHEMA}/1", "truth": seal([case.truth]),
                                   "flights": [flight.name for flight in case.flights]})
    except OSError:
        forget(case.spec, folder)


def kept(spec: CaseSpec, folder: Path) -> Given | None:
    """What ``keep`` wrote; None where it is not whole."""
    place = _place(spec, folder)
    if not (place / SEAL).is_file():
        return None
    try:
        sealed, simulator = read_json(place / SEAL, SCHEMA), read_simulator(place / SIMULATOR)
    except InputError:
        return None
    found = [fetch(place / f"{name}.parquet", f"{name}.csv", "") for name in sealed["flights"]]
    flights = [flight for flight in found if flight is not None]
    return Given(flights, simulator, sealed["truth"]) if len(flights) == len(found) else None


def forget(spec: CaseSpec, folder: Path) -> None:
    shutil.rmtree(_place(spec, folder), ignore_errors=True)


def _place(spec: CaseSpec, folder: Path) -> Path:
    return folder / item_key(keep, {"spec": spec})[:24]

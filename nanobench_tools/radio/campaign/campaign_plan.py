"""Plan of a campaign: paths, controllers, repetitions, and the order of its flights."""

import hashlib
import json
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from ...errors import InputError
from ...practice.references import PathSpec
from ..toml_tables import PATH_KEYS, read_plan

WITHIN_V = 0.05
"""Largest difference of the battery voltages of a pair (protocol of the NanoBench publication)."""
CONTROLLER_KEYS = ("name", "setpoints", "simulator")
REPEATS, MOST_REPEATS = 3, 1000


class FlightId(NamedTuple):
    """``path`` and ``pair`` count from 1. A pair is one flight of every controller."""

    path: int
    pair: int
    controller: str

    def __str__(self) -> str:
        return f"path {self.path}, pair {self.pair}, {self.controller}"


@dataclass(frozen=True)
class CampaignController:
    """``setpoints``: kind of set-points, None for the usual one; ``simulator``: file of a predictive controller."""

    name: str
    setpoints: str | None = None
    simulator: Path | None = None


@dataclass(frozen=True)
class CampaignPlan:
    """``repeats``: pairs of each path; ``within_V``: largest difference of voltages in a pair."""

    paths: tuple[PathSpec, ...]
    controllers: tuple[CampaignController, ...]
    repeats: int
    within_V: float = WITHIN_V

    def pair(self, path: int, number: int) -> tuple[FlightId, ...]:
        """Flights of a pair. The controller that begins alternates, so that none always has the fuller battery."""
        shift = (number - 1) % len(self.controllers)
        order = [*self.controllers[shift:], *self.controllers[:shift]]
        return tuple(FlightId(path, number, controller.name) for controller in order)

    @cached_property
    def pairs(self) -> tuple[tuple[FlightId, ...], ...]:
        """All pairs in their order."""
        return tuple(self.pair(path, number) for number in range(1, self.repeats + 1)
                     for path in range(1, len(self.paths) + 1))

    @cached_property
    def flights(self) -> tuple[FlightId, ...]:
        """All flights in their order."""
        return tuple(flight for pair in self.pairs for flight in pair)

    def controller(self, name: str) -> CampaignController:
        """The controller of that name."""
        return next(found for found in self.controllers if found.name == name)

    @cached_property
    def digest(self) -> str:
        """Identifies the plan: a campaign goes on only with the plan that it began with."""
        text = json.dumps(asdict(self), sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def read_campaign(path: Path) -> CampaignPlan:
    """The plan in a file. Raises InputError in one line for every mistake."""
    table = read_plan(path, ("repeats", "within_V", "controller", "path"))
    paths = tuple(entry.path() for entry in table.tables("path", PATH_KEYS))
    entries = table.tables("controller", CONTROLLER_KEYS)
    controllers = tuple(CampaignController(entry.text("name"), entry.optional_text("setpoints"),
                                           entry.file("simulator")) for entry in entries)
    names = [controller.name for controller in controllers]
    if not paths:
        raise InputError(str(path), "has no [[path]]", "give at least one path")
    if len(names) < 2:
        raise InputError(str(path), f"has {len(names)} [[controller]]", "give at least two, which alternate")
    if twice := next((name for name in names if names.count(name) > 1), ""):
        raise InputError(str(path), f"controller {twice!r} is there twice",
                         "the comparison knows controllers by name: name each once")
    repeats = table.number("repeats", REPEATS, 1, MOST_REPEATS)
    within_V = table.number("within_V", WITHIN_V, 0.01, 1.0)
    if repeats != int(repeats):
        raise InputError(str(path), f"repeats = {repeats:g}", "give a whole number")
    return CampaignPlan(paths, controllers, int(repeats), within_V)

"""The onboard controllers of a crowd of practice vehicles, each behind its own of ``nanobench_tools.firmware``."""

from collections.abc import Sequence
from dataclasses import fields
from typing import TypeVar

import numpy as np

from ..errors import unknown_name
from ..firmware.onboard import PERIOD_S, ControllerLog, Mellinger, PidCascade
from ..methods import Reference, VehicleState
from ..results import array_fields

Batch = TypeVar("Batch", VehicleState, Reference)
CONTROLLERS: dict[str, type[PidCascade] | type[Mellinger]] = {"pid": PidCascade, "mellinger": Mellinger}
"""The controllers of the vehicle by the name the audit gives them."""


class OnboardFleet:
    """Several onboard controllers in one batch: vehicle i flies behind ``CONTROLLERS[names[i]]``."""

    information = "as flown"
    period_s = PERIOD_S

    def __init__(self, names: Sequence[str]) -> None:
        unknown = sorted(set(names) - set(CONTROLLERS))
        if unknown:
            raise unknown_name("controller", unknown[0], CONTROLLERS)
        self.name = "+".join(sorted(set(names)))
        self._rows = {name: np.flatnonzero(np.array(names) == name) for name in CONTROLLERS if name in names}
        self._parts = {name: CONTROLLERS[name]() for name in self._rows}

    def reset(self, n: int) -> None:
        self._reference: Reference | None = None
        for name, rows in self._rows.items():
            self._parts[name].reset(len(rows))

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        if len(self._parts) == 1:
            return next(iter(self._parts.values())).command(time_s, state, reference)
        if reference is not self._reference:  # it stays the same for several commands
            self._reference = reference
            self._references = {name: array_fields.rows(reference, rows) for name, rows in self._rows.items()}
        out = np.empty((len(state.position_m), 4))
        for name, rows in self._rows.items():
            out[rows] = self._parts[name].command(time_s, array_fields.rows(state, rows), self._references[name])
        return out

    @property
    def log(self) -> ControllerLog:
        """The log groups of all."""
        n = sum(map(len, self._rows.values()))
        log = ControllerLog(np.zeros((n, 3)), np.zeros(n), np.zeros(n, dtype=bool))
        for name, rows in self._rows.items():
            part = self._parts[name].log
            for field in fields(log):
                getattr(log, field.name)[rows] = getattr(part, field.name)
        return log



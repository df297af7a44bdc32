"""Data for the plots on the page of a diagnosis, the same for every engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from .wrench import Wrench

Residual = tuple[np.ndarray, np.ndarray]
"""(N, 3) m/s^2 and (M, 3) rad/s^2."""


class Predicted(Protocol):
    """Errors (flights, H, 4) of predictions at ``proof.HORIZONS`` of ``proof.QUANTITIES``."""

    @property
    def flights(self) -> tuple[str, ...]: ...
    @property
    def before(self) -> np.ndarray: ...
    @property
    def after(self) -> np.ndarray: ...
    @property
    def held_out(self) -> bool: ...


@dataclass(frozen=True)
class Structure:
    """Excess of each channel along ``groups`` of covariates, (6, G) before and after; ``chance``: that of a right
    simulator."""

    groups: Sequence[str]
    before: np.ndarray
    after: np.ndarray
    chance: float


@dataclass(frozen=True)
class Left:
    """Data for the plots of a diagnosis: residuals of the given simulator and, if an effect was identified, of the
    corrected one. ``floor`` (6,): RMS of a right simulator. ``scores``: as plotted."""

    wrench: Wrench
    before: Residual
    after: Residual
    named: bool
    floor: np.ndarray
    predicted: Predicted
    scores: Mapping[str, Any]
    structure: Structure | None = None

    def at(self, channel: int) -> np.ndarray:
        """Rows a channel is compared at."""
        return self.wrench.force_at if channel < 3 else self.wrench.torque_at

    def of(self, channel: int) -> list[np.ndarray]:
        """[before, after], or [before] without an identified effect; (n,) each."""
        sides = [self.before, self.after] if self.named else [self.before]
        return [side[channel // 3][:, channel % 3] for side in sides]

"""Task 2: controllers compared over pairs of flights of one path, speed and battery voltage.

A full battery flies better than an empty one, so the published comparison pairs flights whose voltages differ by at
most 0.05 V. The voltage is the mean over the scored spans; the publication does not define it. Every flight is in at
most one pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..flight import mask_of
from ..metrics.statistics import PairedRatio, paired_ratio
from ..results.result import Result
from .sessions import Sessions

if TYPE_CHECKING:
    from .task2 import Case, Tracked

APART_V = 0.05
METRICS = ("rmse_m", "ade_m", "velocity_rmse_m_s", "heading_deg", "rmse_lag_removed_m", "contour_rmse_m")
FAR = 1e6


@dataclass(frozen=True, repr=False)
class VoltagePairs(Result):
    """Errors of ``controller`` over those of ``over``: ``ratios`` by metric; ``pairs``: (flight, flight, V, V)."""

    protocol: str
    reference: str
    speed: str | None
    controller: str
    over: str
    n: int
    pairs: tuple[tuple[str, str, float, float], ...]
    ratios: dict[str, PairedRatio]


def voltage_pairs(scored: Sequence[tuple[Case, Tracked]], seed: int = 0,
                  sessions: Sessions | None = None) -> list[VoltagePairs]:
    """For each path and speed that two controllers flew; none without a pair. Sessions are those of the first of a
    pair."""
    sessions = sessions or Sessions.of(case.flight for case, _ in scored)
    groups: dict[tuple[str, str, str | None], dict[str, list[tuple[Case, Tracked, float]]]] = {}
    for case, value in scored:
        volt = mean_voltage(case)
        if case.spans and np.isfinite(volt):
            group = groups.setdefault((case.protocol, case.reference, case.speed), {})
            group.setdefault(case.controller, []).append((case, value, volt))
    found = []
    for (protocol, reference, speed), by_controller in sorted(groups.items(), key=lambda item: str(item[0])):
        for one, other in combinations(sorted(by_controller), 2):
            pairs = _matched(by_controller[one], by_controller[other])
            if not pairs:
                continue
            a, b = (np.array([[np.nan if (v := value.metrics.get(m)) is None else v for m in METRICS]
                              for _, value, _ in side]) for side in zip(*pairs, strict=True))
            labels = sessions.labels(mine[0].flight for mine, _ in pairs)
            ratios = dict(zip(METRICS, paired_ratio(a, b, seed, labels), strict=True))
            found.append(VoltagePairs(protocol, reference, speed, one, other, len(pairs), tuple(
                (mine[0].flight.name, theirs[0].flight.name, mine[2], theirs[2]) for mine, theirs in pairs), ratios))
    return found


def mean_voltage(case: Case) -> float:
    """Mean battery voltage in the scored spans [V]; nan without one."""
    if "battery" not in case.flight or "vbat" not in case.flight["battery"]:
        return float("nan")
    battery = case.flight["battery"]
    volts = battery["vbat"][mask_of(case.spans, battery.time_s)]
    volts = volts[np.isfinite(volts) & (volts > 0.0)]
    return float(volts.mean()) if len(volts) else float("nan")


Side = Sequence[tuple["Case", "Tracked", float]]


def _matched(ours: Side, theirs: Side) -> list[tuple[tuple[Case, Tracked, float], tuple[Case, Tracked, float]]]:
    """The most pairs that are near enough, and of those sets the one with the smallest sum of differences."""
    apart = np.abs(np.subtract.outer([v for *_, v in ours], [v for *_, v in theirs]))
    rows, columns = linear_sum_assignment(np.where(apart <= APART_V, apart, FAR))
    return [(ours[i], theirs[j]) for i, j in zip(rows, columns, strict=True) if apart[i, j] <= APART_V]

"""Simulated rows of Task 2: references, scores of every plant, median and worst decile over the ensemble."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .. import so3
from ..metrics import tracking
from ..metrics.timing import constant_delay
from ..metrics.trajectory import rms, velocity_rmse
from ..practice.references import FAMILIES, RECORDED, PathSpec, family_named, path_spec
from ..results.result import OPTIONAL, Result

TICK_S = 0.01
HOVER_S, SETTLED_S = 4.0, 3.0
"""Hover before a path begins, in which integrators find the thrust. Then the time before scoring begins, since the
path begins at full speed."""
SECONDS = 12.0
SPEEDS_M_S = (0.5, 1.0)
AHEAD_S = 3.0
"""Known of a path beyond its end."""
LIMIT_M, BACK_M = 50.0, 0.05
SAMPLED = 5
"""Every so many ticks of a flight are kept for pictures."""
MOST_LAG_S = 1.0
LOST_M = 2.0
"""A vehicle further from its path is lost: it has diverged for good."""


@dataclass(frozen=True, repr=False)
class ErrorBar(Result):
    """Error of a simulated RMSE, from the gate over n flights ``of`` a source. It has median and 90th percentile of
    the relative error, and the median distance of the two paths."""

    rmse_share: float
    rmse_share_p90: float
    path_gap_m: float
    n: int
    of: str


@dataclass(frozen=True, repr=False)
class Recovery(Result):
    """Deviation of a disturbed vehicle from its undisturbed flight, and the time until it stays within BACK_M (nan: not
    in this flight)."""

    most_m: float
    back_s: float


@dataclass(frozen=True, repr=False)
class SampledFlight(Result):
    """The flight of the median plant at 20 Hz: time_s (k,), positions (k, 3) m, their distance (k,) m."""

    controller: str
    reference: str
    speed_m_s: float | None
    time_s: np.ndarray
    reference_m: np.ndarray
    flown_m: np.ndarray
    error_m: np.ndarray


@dataclass(frozen=True, repr=False)
class Runs(Result):
    """One controller on many plants: scores of every plant (or of every one of ``cases``) on every path. Also flights
    of the median plant, commands by duration, replaced commands, and every plant's recovery on the first path."""

    controller: str
    information: str
    runs: list[list[dict[str, float]]]
    paths: list[SampledFlight] = field(default_factory=list)
    call_counts: list[int] | None = None
    replaced: Mapping[str, int] = field(default_factory=dict)
    gust: list[Recovery] | None = None
    outage: list[Recovery] | None = None
    cases: Sequence[str] = ()


@dataclass(frozen=True, repr=False)
class SolveTimes(Result):
    """How many commands of a controller took how long: edges_ms (E,), counts (E - 1,)."""

    controller: str
    edges_ms: np.ndarray
    counts: np.ndarray


@dataclass(frozen=True, repr=False)
class Quantiles(Result):
    """Over plants."""

    median: float
    p90: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Quantiles:
        return cls(_quantile(np.array(values, float), 0.5), _quantile(np.array(values, float), 0.9))


@dataclass(frozen=True, repr=False)
class SimulatedRow(Result):
    """One controller on n plants along one path. ``metrics`` are medians, except ``worst_decile_m`` and the share of
    lost vehicles. One plant in ten exceeds ``worst_decile_m``, an RMSE. gust and outage: recovery, on the first path.
    """

    plant: str
    controller: str
    reference: str
    speed_m_s: float | None
    information: str
    n: int
    metrics: Mapping[str, float]
    statistics: Mapping[str, Quantiles]
    error_bar: ErrorBar | None
    replaced: Mapping[str, int]
    gust: Mapping[str, Quantiles] | None = field(default=None, metadata=OPTIONAL)
    outage: Mapping[str, Quantiles] | None = field(default=None, metadata=OPTIONAL)
    radio_delay_s: float = 0.0
    wind_m_s: float = 0.0
    radio_silent_percent: float = 0.0


@dataclass(frozen=True, repr=False)
class MismatchRow(Result):
    """One controller along one path on a plant that differs from the controller's model."""

    plant: str
    case: str
    controller: str
    reference: str
    speed_m_s: float | None
    information: str
    n: int
    metrics: Mapping[str, float]


def specs_of(names: Sequence[str], speeds: Sequence[float], seconds: float = SECONDS) -> list[PathSpec]:
    """Paths by family and speed; a family of one speed once. Raises UsageError."""
    found = []
    for given in names or RECORDED:
        name = family_named(given)
        many = "speed_mps" in {**FAMILIES[name].defaults, **FAMILIES[name].speeds["slow"]}
        found += [path_spec(name, "slow", duration_s=seconds, **({"speed_m_s": float(v)} if many else {}))
                  for v in (speeds or SPEEDS_M_S)[:None if many else 1]]
    return found

CALL_EDGES_MS = np.geomspace(1e-3, 1e2, 51)
"""Bins of the time that a command took."""

@dataclass(frozen=True)
class Paths:
    """References on one clock, every 10 ms: hover where a path begins, then the path, then rest where it ends.

    ``all``: position, velocity, acceleration, jerk (m, k, 3), yaw and its rate (m, k). ``ticks`` are flown, more are
    known.
    """

    specs: tuple[PathSpec, ...]
    time_s: np.ndarray = field(init=False)
    all: tuple[np.ndarray, ...] = field(init=False)

    def __post_init__(self) -> None:
        longest = max(spec.duration_s for spec in self.specs)
        t = TICK_S * np.arange(round((HOVER_S + longest + AHEAD_S) / TICK_S))
        parts = [_path(spec, t) for spec in self.specs]
        object.__setattr__(self, "time_s", t)
        object.__setattr__(self, "all", tuple(np.stack([p[i] for p in parts], axis=1) for i in range(6)))

    @property
    def ticks(self) -> int:
        return round((HOVER_S + max(spec.duration_s for spec in self.specs)) / TICK_S)

    def scored(self, path: int) -> slice:
        """Ticks that count."""
        return slice(round((HOVER_S + SETTLED_S) / TICK_S), round((HOVER_S + self.specs[path].duration_s) / TICK_S))


def _path(spec: PathSpec, t: np.ndarray) -> list[np.ndarray]:
    since = np.clip(t - HOVER_S, 0.0, spec.duration_s)
    full = spec.reference(since)
    moves = (t >= HOVER_S) & (t <= HOVER_S + spec.duration_s)
    jerk, turn = full.jerk_m_s3, full.yaw_rate_rad_s
    moving = [np.where(moves[:, None], x, 0.0) for x in (full.velocity_m_s, full.acceleration_m_s2,
                                                         np.zeros((len(t), 3)) if jerk is None else jerk)]
    rate = np.where(moves, np.zeros(len(t)) if turn is None else turn, 0.0)
    return [full.position_m, *moving, full.yaw_rad, rate]


def score(flown: Any, paths: Paths, plants: int, period_s: float) -> list[list[dict[str, float]]]:
    """Of every path the scores of every plant; lanes of ``flown`` (``plants.closed_loop.Flown``) are paths x
    plants, paths outermost."""
    found = []
    calls = np.asarray(flown.call_s)
    timing = {"solve_p99_ms": 1e3 * float(np.quantile(calls, 0.99)) if len(calls) else float("nan"),
              "deadline_missed_percent": 100.0 * float(np.mean(calls > period_s)) if len(calls) else float("nan")}
    for k in range(len(paths.specs)):
        rows = paths.scored(k)
        t = paths.time_s[rows]
        goal, speed, yaw = paths.all[0][rows, k], paths.all[1][rows, k], paths.all[4][rows, k]
        for_all = []
        for i in range(k * plants, (k + 1) * plants):
            one = _metrics(t, flown.position_m[rows, i], flown.velocity_m_s[rows, i], flown.quaternion[rows, i],
                           flown.motor[rows, i], goal, speed, yaw)
            whole = slice(paths.ticks)
            one["contour_rmse_m"] = rms(_contour(flown.position_m[whole, i], paths.all[0][whole, k])[rows])
            for_all.append({**one, **timing})
        found.append(for_all)
    return found


def solve_times(results: Sequence[Runs]) -> list[SolveTimes]:
    """Over all results of a controller; the first and the last bin hold what is beyond."""
    found: dict[str, np.ndarray] = {}
    for result in results:
        if result.call_counts is not None:
            found[result.controller] = found.get(result.controller, 0) + np.array(result.call_counts, int)
    return [SolveTimes(name, CALL_EDGES_MS, counts) for name, counts in found.items()]


def call_counts(call_s: np.ndarray) -> list[int]:
    """Commands by the time they took, in the bins of CALL_EDGES_MS."""
    inside = np.clip(1e3 * np.asarray(call_s, float), CALL_EDGES_MS[0], CALL_EDGES_MS[-1])
    return [int(count) for count in np.histogram(inside, CALL_EDGES_MS)[0]]


def _metrics(t: np.ndarray, position: np.ndarray, velocity: np.ndarray, quaternion: np.ndarray, motor: np.ndarray,
             goal: np.ndarray, speed: np.ndarray, yaw: np.ndarray) -> dict[str, float]:
    position, velocity = _bounded(position), _bounded(velocity)
    errors = tracking.position_errors(position, goal)
    lost = bool(errors.max() > LOST_M)
    moves = np.ptp(goal, axis=0).max() > BACK_M
    delay = constant_delay(t, position, t, goal, MOST_LAG_S) if moves and not lost else None
    heading = np.nan_to_num(so3.euler_zyx(quaternion)[:, 2])
    return {"rmse_m": rms(errors), "ade_m": float(errors.mean()),
            "velocity_rmse_m_s": velocity_rmse(velocity, speed),
            "heading_deg": tracking.heading_error_deg(heading, yaw),
            "divergence_percent": tracking.divergence_percent(errors),
            "rmse_lag_removed_m": rms(errors) if delay is None else delay.rmse_after_m,
            "lag_s": float("nan") if delay is None else delay.delay_s,
            "worst_decile_in_flight_m": tracking.worst_decile(errors), "lost_percent": 100.0 * lost,
            "effort_1_s": float(np.mean(np.abs(np.diff(motor, axis=0))) / TICK_S),
            "saturated_percent": tracking.saturated_percent(motor)}


def _bounded(values: np.ndarray) -> np.ndarray:
    """A vehicle that is lost is LIMIT_M away."""
    return np.asarray(np.clip(np.nan_to_num(values, nan=LIMIT_M), -LIMIT_M, LIMIT_M))


def _contour(position: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """(m,) m: distance to the whole path, regardless of time."""
    return tracking.contour_errors(_bounded(position), goal)


def sampled(controller: str, flown: Any, paths: Paths, plants: int) -> list[SampledFlight]:
    """Of every path the flight of the median plant."""
    found = []
    for k, spec in enumerate(paths.specs):
        rows = slice(round(HOVER_S / TICK_S), paths.scored(k).stop, SAMPLED)
        goal, flew = paths.all[0][rows, k], _bounded(flown.position_m[rows, k * plants])
        away = tracking.position_errors(flew, goal)
        found.append(SampledFlight(controller, spec.family, spec.params.get("speed_mps"),
                                   np.round(paths.time_s[rows] - HOVER_S, 3), np.round(goal, 4), np.round(flew, 4),
                                   np.round(away, 5)))
    return found


def recovery(bent_m: np.ndarray, calm_m: np.ndarray, time_s: np.ndarray, begin_s: float) -> list[Recovery]:
    """Of every plant, from a disturbance begun at begin_s. Both (m, n, 3) at time_s (m,)."""
    rows = time_s >= begin_s
    away = np.linalg.norm(bent_m[rows] - calm_m[rows], axis=2)
    t = time_s[rows] - begin_s
    found = []
    for one in away.T:
        out = np.flatnonzero(~(one < BACK_M))
        back = 0.0 if not len(out) else float(t[out[-1]]) if out[-1] + 1 < len(t) else float("nan")
        found.append(Recovery(float(np.nan_to_num(one, nan=LIMIT_M).max()), back))
    return found


def tabulate(results: Sequence[Runs], specs: Sequence[PathSpec], error_bar: ErrorBar | None = None,
             radio_delay_s: float = 0.0, wind_m_s: float = 0.0,
             radio_silent_percent: float = 0.0) -> list[SimulatedRow]:
    """A row for each controller and path."""
    rows = []
    for result in results:
        for k, spec in enumerate(specs):
            plants = result.runs[k]
            statistics = {name: Quantiles.of([p[name] for p in plants]) for name in plants[0]}
            lost = float(np.mean(np.array([p["lost_percent"] for p in plants], float)))
            bent = {what: {name: Quantiles.of([getattr(p, name) for p in found]) for name in ("most_m", "back_s")}
                    for what in ("gust", "outage") if k == 0 and (found := getattr(result, what)) is not None}
            rows.append(SimulatedRow(
                "simulated", result.controller, spec.family, spec.params.get("speed_mps"), result.information,
                len(plants), {**{name: s.median for name, s in statistics.items()},
                              "worst_decile_m": statistics["rmse_m"].p90, "median_plant_m": plants[0]["rmse_m"],
                              "lost_percent": lost},
                statistics, error_bar, result.replaced, **bent, radio_delay_s=radio_delay_s, wind_m_s=wind_m_s,
                radio_silent_percent=radio_silent_percent))
    return rows


def tabulate_cases(result: Runs, specs: Sequence[PathSpec]) -> list[MismatchRow]:
    """Rows of one controller on plants that each differ from its model."""
    return [MismatchRow("mismatch", case, result.controller, spec.family, spec.params.get("speed_mps"),
                        result.information, 1, {**(one := result.runs[k][i]), "worst_decile_m": one["rmse_m"]})
            for i, case in enumerate(result.cases) for k, spec in enumerate(specs)]


def _quantile(values: np.ndarray, share: float) -> float:
    """nan counts as the worst; the result is nan if the quantile falls among those."""
    ordered = np.sort(np.where(np.isnan(values), np.inf, values))
    found = float(ordered[min(int(share * len(ordered)), len(ordered) - 1)]) if len(ordered) else float("inf")
    return found if np.isfinite(found) else float("nan")

"""What the onboard filter's error on recordings comes from: its logged estimate by clock, and its replay with one
thing changed at a time.

The clock of ``offset`` and ``retimed`` cases must be set without the estimated position and velocity
(``moving.votes``). Otherwise judging the estimate on it is circular. Replay: the firmware's filter on the re-timed IMU
with a pose every 10 ms, undelayed.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .. import so3
from ..firmware.kalman import defaults
from ..flight import Flight
from ..flight import mask_of as inside
from ..methods import Estimate, Estimator
from ..metrics.statistics import Labels, Summary
from ..metrics.trajectory import rms
from ..results.result import INLINE, Result
from ..settings import number
from ..signals.onboard_estimate import OnboardEkf
from .aided import Aiding, given_to
from .score_tables import summaries
from .sessions import Drawn
from .task3 import Case, score_given

WHOLE = Aiding(rate_hz=100.0, delay_s=0.0, noise_m=0.0)
LATE_S = number("tasks.attribution.late_s")
LOST = number("tasks.attribution.lost")
"""The lag of the logged position behind the gyro, and the share of IMU packets that did not arrive."""

SCORES = {"ate_m": "ate_rmse_m", "along_m": "along_track_rmse_m", "across_m": "across_track_rmse_m"}
"""ATE after SE(3) alignment; along and across the track without."""


@dataclass(frozen=True)
class Filters:
    """firmware(parameters=None, held=False): the vehicle's filter; another: one to compare it with."""

    firmware: Callable[..., Estimator]
    another: Estimator


def _replay(filters: Filters, case: Case, retimed: Case) -> Estimate:
    return filters.firmware().estimate(given_to(retimed, WHOLE))


def _as_recorded(filters: Filters, case: Case, retimed: Case) -> Estimate:
    return filters.firmware().estimate(given_to(case, WHOLE))


def _late_poses(filters: Filters, case: Case, retimed: Case) -> Estimate:
    return filters.firmware().estimate(given_to(retimed, replace(WHOLE, delay_s=LATE_S)))


def _lost_poses(filters: Filters, case: Case, retimed: Case) -> Estimate:
    return filters.firmware().estimate(given_to(retimed, replace(WHOLE, loss=LOST)))


def _held_rows(filters: Filters, case: Case, retimed: Case) -> Estimate:
    return filters.firmware(held=True).estimate(given_to(retimed, WHOLE))


def _with_drag(filters: Filters, case: Case, retimed: Case) -> Estimate:
    """Stopped motors: the filter then integrates all of the accelerometer, not thrust alone, and so sees drag."""
    flight = given_to(retimed, WHOLE)
    motor = flight["motor"]
    return filters.firmware().estimate(flight.with_streams(motor=replace(motor, values=np.zeros_like(motor.values))))


def _noisier(filters: Filters, case: Case, retimed: Case) -> Estimate:
    """Twice the process noise of its accelerations; it starts at the first pose all the same."""
    flight, found = given_to(retimed, WHOLE), defaults()
    mocap = flight["mocap"]
    found["initial_m"] = mocap["px", "py", "pz"][0]
    found["initial_yaw_rad"] = so3.euler_zyx(mocap["qx", "qy", "qz", "qw"][:1])[0, 2]
    for name in ("acc_xy_m_s2", "acc_z_m_s2"):
        found[name] = 2.0 * found[name]
    return filters.firmware(found).estimate(flight)


def _another(filters: Filters, case: Case, retimed: Case) -> Estimate:
    return filters.another.estimate(given_to(retimed, WHOLE))


@dataclass(frozen=True, repr=False)
class AttributionRow(Result):
    """Summaries over n flights of ``what``: a clock, or what was changed."""

    what: str
    n: int
    drawn: Drawn | None = field(metadata=INLINE)
    metrics: Mapping[str, Summary]


@dataclass(frozen=True, repr=False)
class Attribution(Result):
    """The logged estimate of n flights by clock, and the replays of n_replayed."""

    n: int
    n_replayed: int
    logged: Sequence[AttributionRow]
    replayed: Sequence[AttributionRow]


BASE = "replay on the re-timed IMU"
REPLAYS: dict[str, Callable[[Filters, Case, Case], Estimate]] = {
    BASE: _replay,
    "IMU as recorded (telemetry clock)": _as_recorded,
    f"poses {1e3 * LATE_S:.0f} ms late": _late_poses,
    f"{100 * LOST:.0f} % of the poses lost": _lost_poses,
    "IMU rows held, not on lines": _held_rows,
    "drag seen (all of the accelerometer)": _with_drag,
    "process noise doubled (parameters)": _noisier,
    "another filter (drag_matrix_ekf)": _another,
}


class Made:
    """An estimate that is there already, to be scored as all are."""

    name, causal = "made", True

    def __init__(self, estimate: Estimate) -> None:
        self.made = estimate

    def estimate(self, flight: Flight) -> Estimate:
        return self.made


def _scores(case: Case, estimate: Estimate) -> dict[str, float]:
    found = score_given(case, Made(estimate), "clean", case.flight, -np.inf).metrics
    return {name: float("nan") if (value := found[metric]) is None else value for name, metric in SCORES.items()}


def logged(case: Case) -> dict[str, float]:
    """{ate_m, along_m, across_m} of what the vehicle logged, on the clock of the case."""
    return _scores(case, OnboardEkf().estimate(case.flight))


def replays(filters: Filters, recorded: Case, retimed: Case) -> dict[str, dict[str, float]]:
    """{what was changed: {ate_m; ``change_m``: of the ATE against the replay with nothing changed; ``moves_m``: RMS
    distance of the two estimates}} of one flight, judged on the re-timed clock."""
    made = {name: make(filters, recorded, retimed) for name, make in REPLAYS.items()}
    base = made[BASE]
    level = _scores(retimed, base)["ate_m"]
    found = {}
    for name, estimate in made.items():
        ate_m = _scores(retimed, estimate)["ate_m"]
        found[name] = {"ate_m": ate_m, "change_m": ate_m - level, "moves_m": _apart(retimed, base, estimate)}
    return found


def _apart(case: Case, a: Estimate, b: Estimate) -> float:
    """RMS distance of two estimates in the scored spans [m], at the timestamps of a."""
    rows = inside(case.spans, a.time_s)
    other = np.stack([np.interp(a.time_s[rows], b.time_s, b.position_m[:, k]) for k in range(3)], axis=1)
    return rms(np.linalg.norm(a.position_m[rows] - other, axis=1))


def tabulate(logged_by_clock: Mapping[str, Sequence[Mapping[str, float]]],
             replayed: Sequence[Mapping[str, Mapping[str, float]]], seed: int = 0,
             sessions: Mapping[str, Labels] | None = None) -> Attribution:
    """sessions: those of the flights, by clock, and of the ``replayed`` ones."""
    what, of = list(replayed[0]) if replayed else [], sessions or {}
    return Attribution(min(map(len, logged_by_clock.values())), len(replayed),
                       [_row(clock, found, seed, of.get(clock)) for clock, found in logged_by_clock.items()],
                       [_row(name, [one[name] for one in replayed], seed, of.get("replayed")) for name in what])


def _row(what: str, scores: Sequence[Mapping[str, float]], seed: int, sessions: Labels) -> AttributionRow:
    metrics = summaries(scores, seed, sessions)
    return AttributionRow(what, len(scores), None if sessions is None else Drawn.of(np.asarray(sessions), metrics),
                          metrics)

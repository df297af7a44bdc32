"""Parameters of the vehicle's own Kalman filter from recordings: drag, and how far it trusts poses and gyro.

Drag is a regression of the horizontal specific force on the velocity of the motion capture in body axes. The settings
of the pose and the gyro are searched by running the firmware's filter again. Every flight is scored with parameters
that were found without its part (``parts``). A part is a session where there are several, else every fifth flight.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from .. import so3
from ..auditing.usable import POSE
from ..errors import InputError
from ..flight import Flight
from ..flight import mask_of as inside
from ..methods import Estimate, Estimator
from ..metrics.statistics import Labels, PairedRatio, Summary, paired_ratio, session_count, weights
from ..results.result import INLINE, OPTIONAL, Result
from ..settings import number
from ..signals.onboard_estimate import OnboardEkf
from .aided import Aiding, given_to
from .attribution import Made
from .score_tables import summaries
from .sessions import Drawn
from .task3 import Case, score_given

RATE_HZ = 100.0
NOISE_M = 1e-3
"""SD of the noise put on poses where errors are scored. The truth is these poses: without it, a filter that copies them
would have no error."""
SETTLED_S = 2.0
"""After the start of the flight; the filter has converged."""
BETWEEN_S, OUTAGES_S = 5.0, (1.0, 5.0)
"""Poses for 5 s, then none for 1 or 5 s, and so on."""
MINIMUM_SPREAD_M_S = number("tasks.onboard_tuning.minimum_spread_m_s")
FOLDS = 5
SEARCHED_ON = 10
"""Flights that a search runs the filter on, evenly chosen."""
STEPS = (3.0, 1.7, 1.3)
BOUNDS = {"position_sd_m": (1e-3, 0.05), "attitude_sd_rad": (2e-3, 0.5), "gyro_rad_s": (0.01, 1.0)}
DELAYS_S = tuple(0.005 * k for k in range(13))
POSE_SDS = tuple((position, attitude) for position in (1e-3, 3e-3, 1e-2) for attitude in (4.5e-3, 0.02, 0.05, 0.2))
"""SD of a pose that an operator may have set: from 1 mm and 0.05 rad (Crazyswarm2) to the firmware's 10 mm and 4.5
mrad."""

METRICS = {"ate_m": "ate_rmse_m", "ate_delay_removed_m": "ate_delay_removed_rmse_m",
           "velocity_m_s": "velocity_rmse_m_s", "attitude_deg": "attitude_rmse_deg"}

Firmware = Callable[..., Estimator]
"""firmware(pose_sd=(m, rad), changes={field: value}) is the vehicle's filter."""


@dataclass(frozen=True, repr=False)
class Settings(Result):
    """Parameters of the firmware's filter. drag: 1/s along body x and y. ``dragB_z`` stays 0, because the measured
    specific force along z includes drag. pressure_z_m: height of the centre of pressure."""

    drag_x_1_s: float = 0.0
    drag_y_1_s: float = 0.0
    pressure_z_m: float = 0.0
    position_sd_m: float = 0.01
    attitude_sd_rad: float = 4.5e-3
    gyro_rad_s: float = 0.1

    def named(self) -> dict[str, float]:
        """By the firmware's names, rounded to four digits."""
        found = {"kalman.dragB_x": self.drag_x_1_s, "kalman.dragB_y": self.drag_y_1_s, "kalman.dragB_z": 0.0,
                 "kalman.cop_x": 0.0, "kalman.cop_y": 0.0, "kalman.cop_z": self.pressure_z_m,
                 "locSrv.extPosStdDev": self.position_sd_m, "locSrv.extQuatStdDev": self.attitude_sd_rad,
                 "kalman.mNGyro_rollpitch": self.gyro_rad_s, "kalman.mNGyro_yaw": self.gyro_rad_s}
        return {name: float(f"{value:.4g}") for name, value in found.items()}


def run(firmware: Firmware, flight: Flight, settings: Settings) -> Estimate:
    """The filter with these settings on a flight with its poses."""
    changes = {"drag_1_s": (settings.drag_x_1_s, settings.drag_y_1_s, 0.0),
               "pressure_m": (0.0, 0.0, settings.pressure_z_m),
               "gyro_tilt_rad_s": settings.gyro_rad_s, "gyro_yaw_rad_s": settings.gyro_rad_s}
    return firmware(pose_sd=(settings.position_sd_m, settings.attitude_sd_rad), changes=changes).estimate(flight)


def arriving(case: Case, delay_s: float, noise_m: float = 0.0) -> Flight:
    """The flight with a pose every 10 ms, each ``delay_s`` late."""
    return given_to(case, Aiding(rate_hz=RATE_HZ, delay_s=delay_s, noise_m=noise_m))


# --- drag


@dataclass(frozen=True)
class DragSums:
    """Normal equations of one flight for axes x and y. Unknowns: drag [1/s], and drag times the height of the centre of
    pressure [m/s]. spread_m_s (2,): SD of the velocity in body axes."""

    left: np.ndarray
    right: np.ndarray
    rows: int
    spread_m_s: np.ndarray


def drag_sums(case: Case) -> DragSums:
    """Of the airborne rows of the IMU. Means are removed: the bias of the accelerometer and its tilt."""
    flight, (truth_s, _, truth_m_s, quaternion) = case.flight, _truth(case)
    imu = flight["imu"]
    rows = inside(case.spans, imu.time_s) & (imu.time_s > case.spans[0].start_s + SETTLED_S)
    rows &= (imu.time_s <= truth_s[-1]) & np.isfinite(imu.values).all(axis=1)
    left, right = np.zeros((2, 2, 2)), np.zeros((2, 2))
    if np.sum(rows) < RATE_HZ:
        return DragSums(left, right, 0, np.zeros(2))
    time_s = imu.time_s[rows]
    turned = Rotation.from_quat(so3.interpolate(truth_s, quaternion, time_s)).inv()
    body = turned.apply(_interpolated(time_s, truth_s, truth_m_s))
    acc, rate = imu["acc_x", "acc_y"][rows], imu["gyro_x", "gyro_y"][rows]
    for axis, lever in ((0, rate[:, 1]), (1, -rate[:, 0])):
        columns = np.column_stack([-body[:, axis], lever])
        columns = columns - columns.mean(axis=0)
        left[axis] = columns.T @ columns
        right[axis] = columns.T @ (acc[:, axis] - acc[:, axis].mean())
    return DragSums(left, right, int(np.sum(rows)), body[:, :2].std(axis=0))


@dataclass(frozen=True, repr=False)
class Drag(Result):
    """1/s along body x and y, and the height of the centre of pressure [m] that the same regression finds.

    ci95: intervals; None where the flights are of one session. Negative pressure_z_m: below, in the firmware's sign.
    """

    drag_1_s: tuple[float, float]
    ci95: Sequence[tuple[float, float]] | None
    pressure_z_m: float
    n: int


def fit_drag(sums: Sequence[DragSums], sessions: Labels = None, seed: int = 0) -> Drag:
    """Over all rows of flights; the interval draws sessions, then flights. InputError where the flights are too slow
    to show drag."""
    used = [one for one in sums if one.rows]
    slow = max((float(one.spread_m_s.min()) for one in used), default=0.0)
    if slow < MINIMUM_SPREAD_M_S:
        raise InputError("drag", f"no flight moves along body x and y by more than {slow:.2f} m/s (SD); "
                                 f"{MINIMUM_SPREAD_M_S:g} are needed",
                         "record a figure 8 or a circle at 0.5 m/s or more")
    left, right = np.stack([one.left for one in sums]), np.stack([one.right for one in sums])
    drag, pressure = _solved(left.sum(axis=0), right.sum(axis=0))
    found = (float(drag[0]), float(drag[1]))
    if (draws := weights(len(sums), sessions, seed)) is None:
        return Drag(found, None, pressure, len(used))
    drawn = [_solved(np.tensordot(w, left, 1), np.tensordot(w, right, 1))[0] for w in draws
             if (np.tensordot(w, left, 1)[:, 0, 0] > 0.0).all()]
    low, high = np.percentile(drawn, [2.5, 97.5], axis=0)
    return Drag(found, [(float(a), float(b)) for a, b in zip(low, high, strict=True)], pressure, len(used))


def _solved(left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, float]:
    """Drag (2,) alone, and the centre of pressure that both axes agree on where both are fitted."""
    both = np.stack([np.linalg.lstsq(left[axis], right[axis], rcond=None)[0] for axis in (0, 1)])
    total = float(both[:, 0].sum())
    return right[:, 0] / left[:, 0, 0], float(both[:, 1].sum() / total) if total > 0.0 else 0.0


# --- as flown


@dataclass(frozen=True, repr=False)
class Flown(Result):
    """Settings in flight: those whose replay is nearest to the logged estimate. delay_s: of the poses.

    apart_m, apart_m_s: median over n flights of the RMS distance of position and velocity, means removed. span_s: of
    the delays that single flights prefer."""

    position_sd_m: float
    attitude_sd_rad: float
    delay_s: float
    apart_m: float | None
    apart_m_s: float | None
    span_s: tuple[float, float] | None
    n: int

    @property
    def settings(self) -> Settings:
        return Settings(position_sd_m=self.position_sd_m, attitude_sd_rad=self.attitude_sd_rad)


@dataclass(frozen=True)
class Distances:
    """apart (12, 13, 2) m and m/s: RMS distance of the replay from the logged estimate, for all POSE_SDS and DELAYS_S;
    nan without an estimate."""

    apart: np.ndarray


def distances(case: Case, firmware: Firmware) -> Distances:
    """Of one flight."""
    found = np.full((len(POSE_SDS), len(DELAYS_S), 2), np.nan)
    if "estimator" not in case.flight or not {"attitude", "attitude_qw"} & set(case.flight.streams):
        return Distances(found)
    logged = OnboardEkf().estimate(case.flight)
    for j, delay_s in enumerate(DELAYS_S):
        flight = arriving(case, delay_s)
        for i, (position, attitude) in enumerate(POSE_SDS):
            replay = run(firmware, flight, Settings(position_sd_m=position, attitude_sd_rad=attitude))
            found[i, j] = _apart(case, logged, replay)
    return Distances(found)


def _apart(case: Case, logged: Estimate, replay: Estimate) -> tuple[float, float]:
    t = logged.time_s
    rows = inside(case.spans, t) & (t > case.spans[0].start_s + SETTLED_S) & (t <= replay.time_s[-1])
    rows &= np.isfinite(logged.position_m).all(axis=1)
    off = logged.position_m[rows] - _interpolated(t[rows], replay.time_s, replay.position_m)
    if logged.velocity_m_s is None or replay.velocity_m_s is None:
        return _spread(off), float("nan")
    return _spread(off), _spread(logged.velocity_m_s[rows] - _interpolated(t[rows], replay.time_s, replay.velocity_m_s))


def _spread(off: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum((off - off.mean(axis=0)) ** 2, axis=1)))) if len(off) else float("nan")


def as_flown(found: Sequence[Distances], delay_s: float | None = None) -> Flown:
    """From ``distances`` of flights; the firmware's defaults and ``delay_s`` (or 0) where none has a logged estimate.
    ``delay_s``: instead of the one that is found."""
    known = [one.apart for one in found if np.isfinite(one.apart[..., 0]).all()]
    if not known:
        default = Settings()
        return Flown(default.position_sd_m, default.attitude_sd_rad, delay_s or 0.0, None, None, None, 0)
    place = np.stack(known)[..., 0]
    sd = int(np.argmin(place.min(axis=2).mean(axis=0)))
    nearest = place[:, sd].argmin(axis=1)
    delay = int(np.argmin(place[:, sd].mean(axis=0))) if delay_s is None else int(np.argmin(np.abs(
        np.array(DELAYS_S) - delay_s)))
    apart = np.nanmedian(np.stack(known)[:, sd, delay], axis=0)
    return Flown(*POSE_SDS[sd], DELAYS_S[delay] if delay_s is None else delay_s, float(apart[0]),
                 float(apart[1]) if np.isfinite(apart[1]) else None,
                 (DELAYS_S[int(nearest.min())], DELAYS_S[int(nearest.max())]), len(known))


# --- search


def search(cases: Sequence[Case], start: Settings, delay_s: float, firmware: Firmware) -> Settings:
    """SDs of pose and gyro with the smallest product of errors, on at most SEARCHED_ON of the cases.

    Errors are those of position, velocity and attitude, and of the position after an outage of 1 s. The search changes
    one parameter at a time by the factors STEPS. Poses are ``delay_s`` late and have noise of NOISE_M."""
    chosen = [cases[int(k)] for k in np.unique(np.linspace(0, len(cases) - 1, SEARCHED_ON).round())]
    whole = [arriving(case, delay_s, NOISE_M) for case in chosen]
    holed = [_holed(case, flight, OUTAGES_S[0]) for case, flight in zip(chosen, whole, strict=True)]

    def cost(settings: Settings) -> float:
        errors = [_quick(firmware, settings, *given) for given in zip(chosen, whole, holed, strict=True)]
        return float(np.sum(np.log(np.nanmean(errors, axis=0) + 1e-9)))

    best, least = start, cost(start)
    for step in STEPS:
        moved = True
        while moved:
            moved = False
            for name, (low, high) in BOUNDS.items():
                for factor in (step, 1.0 / step):
                    value = float(np.clip(getattr(best, name) * factor, low, high))
                    tried = replace(best, **{name: value})
                    if value != getattr(best, name) and (found := cost(tried)) < least - 1e-3:
                        best, least, moved = tried, found, True
    return best


def _quick(firmware: Firmware, settings: Settings, case: Case, whole: Flight, holed: Flight) -> tuple[float, ...]:
    """RMS errors of position [m], velocity [m/s] and attitude [rad], and the mean end error of outages of 1 s [m]."""
    truth_s, truth_m, truth_m_s, quaternion = _truth(case)
    found = run(firmware, whole, settings)
    rows = inside(case.spans, truth_s) & (truth_s > case.spans[0].start_s + SETTLED_S) & (truth_s <= found.time_s[-1])
    t = truth_s[rows]
    velocity = np.zeros_like(found.position_m) if found.velocity_m_s is None else found.velocity_m_s
    place = _spread(_interpolated(t, found.time_s, found.position_m) - truth_m[rows])
    speed = _spread(_interpolated(t, found.time_s, velocity) - truth_m_s[rows])
    turned = so3.geodesic_angle(so3.interpolate(found.time_s, found.quaternion, t), quaternion[rows])
    ends = end_errors(case, run(firmware, holed, settings), OUTAGES_S[0])
    return place, speed, float(np.sqrt(np.mean(turned**2))), float(np.mean(ends)) if len(ends) else float("nan")


def _holed(case: Case, flight: Flight, outage_s: float) -> Flight:
    """Poses for BETWEEN_S, none for ``outage_s``, and so on, from BETWEEN_S after the start."""
    mocap = flight["mocap"]
    since = mocap.time_s - case.spans[0].start_s - BETWEEN_S
    kept = (since < 0.0) | (since % (BETWEEN_S + outage_s) >= outage_s)
    return flight.with_streams(mocap=replace(mocap, time_s=mocap.time_s[kept], values=mocap.values[kept]))


def end_errors(case: Case, estimate: Estimate, outage_s: float) -> np.ndarray:
    """(k,) m: horizontal error at the end of every outage that lies in one scored span."""
    truth_s, truth_m, _, _ = _truth(case)
    first = case.spans[0].start_s + BETWEEN_S + outage_s
    ends = np.arange(first, min(case.spans[-1].end_s, estimate.time_s[-1]), BETWEEN_S + outage_s)
    ends = np.array([end for end in ends if any(span.start_s <= end - outage_s and end <= span.end_s
                                                for span in case.spans)])
    off = _interpolated(ends, estimate.time_s, estimate.position_m) - _interpolated(ends, truth_s, truth_m)
    return np.asarray(np.hypot(off[:, 0], off[:, 1]))


# --- scores


def score(case: Case, settings: Settings, delay_s: float, firmware: Firmware) -> dict[str, float]:
    """METRICS of the filter run again, and the mean horizontal error at the end of outages of 1 and 5 s."""
    whole = arriving(case, delay_s, NOISE_M)
    found = _metrics(case, run(firmware, whole, settings))
    for outage_s in OUTAGES_S:
        ends = end_errors(case, run(firmware, _holed(case, whole, outage_s), settings), outage_s)
        found[f"end_{outage_s:.0f}s_m"] = float(np.mean(ends)) if len(ends) else float("nan")
    return found


def score_logged(case: Case) -> dict[str, float]:
    """METRICS of the estimate that was logged in flight."""
    return _metrics(case, OnboardEkf().estimate(case.flight))


def _metrics(case: Case, estimate: Estimate) -> dict[str, float]:
    found = score_given(case, Made(estimate), "clean", case.flight, case.spans[0].start_s + SETTLED_S).metrics
    return {name: float("nan") if (value := found.get(metric)) is None else value for name, metric in METRICS.items()}


def _truth(case: Case) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    mocap = case.flight["mocap"]
    rows = np.isfinite(mocap[(*POSE, "vx", "vy", "vz")]).all(axis=1) & np.isfinite(mocap.time_s)
    return (mocap.time_s[rows], mocap["px", "py", "pz"][rows], mocap["vx", "vy", "vz"][rows],
            mocap["qx", "qy", "qz", "qw"][rows])


def _interpolated(time_s: np.ndarray, known_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(time_s, known_s, column) for column in values.T], axis=1)


# --- parts and tables


def parts(names: Sequence[str], sessions: Labels) -> tuple[list[list[str]], str]:
    """Names that are held out together, and in words what they are."""
    found = session_count(sessions)
    if found is not None and found > 1:
        labels = np.asarray(sessions, int)
        return [[name for name, label in zip(names, labels, strict=True) if label == k] for k in np.unique(labels)], (
            f"whole sessions ({found})")
    folds = min(FOLDS, len(names))
    return [list(names[k::folds]) for k in range(folds)], f"every {folds}th flight, of the same session"


@dataclass(frozen=True, repr=False)
class TuningRow(Result):
    """One filter over n flights.

    Attributes
    ----------
    what : str
        ``logged estimate``, or the settings with which the filter was run again.
    clock : str
        ``as-recorded`` or ``retimed``.
    n : int
        Number of flights.
    drawn : Drawn
        Basis of the intervals.
    metrics : mapping
        Statistics over flights by metric.
    ratios : mapping
        Errors over those of ``replay as flown`` on the same flights.
    """

    what: str
    clock: str
    n: int
    drawn: Drawn | None = field(metadata=INLINE)
    metrics: Mapping[str, Summary]
    ratios: Mapping[str, PairedRatio] | None = field(default=None, metadata=OPTIONAL)


LOGGED, FLOWN, DRAG = "logged estimate", "replay as flown", "with drag"
PRESSURE, TUNED = "with drag and centre of pressure", "with drag and noise settings"


@dataclass(frozen=True, repr=False)
class OnboardTuning(Result):
    """Content of tune_onboard.json.

    Attributes
    ----------
    parameters : mapping
        Values to set, by the firmware's names, found on all flights.
    drag : Drag
        Drag along body x and y [1/s] with intervals, and the height of the centre of pressure [m].
    flown : Flown
        Settings in flight: standard deviations of poses, and their delay [s].
    held_out : str
        Which flights are left out together.
    rows : list of TuningRow
        Scores of the logged estimate and of the filter run again, by settings and clock.
    by_part : list of Settings
        Settings that score each part.
    flights : list of str
        Names of the flights.
    """

    parameters: Mapping[str, float]
    drag: Drag
    flown: Flown
    held_out: str
    rows: Sequence[TuningRow]
    by_part: Sequence[Settings]
    flights: Sequence[str]

    def row(self, what: str, clock: str) -> TuningRow | None:
        return next((row for row in self.rows if row.what == what and row.clock == clock), None)


def tabulate(scores: Mapping[tuple[str, str], Mapping[str, Mapping[str, float]]], sessions: Mapping[str, int],
             seed: int = 0) -> list[TuningRow]:
    """Rows of {(what, clock): {flight: scores}}; ratios are to FLOWN on the same clock."""
    rows = []
    for (what, clock), found in scores.items():
        if not found:
            continue
        labels = np.array([sessions[name] for name in found])
        metrics = summaries(found.values(), seed, labels)
        base = scores.get((FLOWN, clock), {})
        both = [name for name in found if name in base]
        ratios = None
        if what != FLOWN and both:
            keys = [key for key in metrics if all(key in base[name] for name in both)]
            ours, theirs = (np.array([[one[name][key] for key in keys] for name in both]) for one in (found, base))
            told = paired_ratio(ours, theirs, seed, np.array([sessions[name] for name in both]))
            ratios = dict(zip(keys, told, strict=True))
        rows.append(TuningRow(what, clock, len(found), Drawn.of(labels, metrics), metrics, ratios))
    return rows

"""The gate of Task 2: does the plant, flown by the controller that flew, do what the recording did?

A case is a held-out recording from its first to its last airborne time, as far as its log is alive. The repeated flight
(``controllers.plants.gate_flights``) gets setpoints, battery, radio gaps and the initial state as logged, and no more.
It passes on three conditions.

- The RMSE to the setpoints is within RATIO of the real one.
- The lag behind them is within LAG_S.
- The median distance of the two paths is below GAP_M.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import welch

from ..auditing.faults.kinds import cutting_logs
from ..auditing.recording_audit import Audit
from ..auditing.selection import distinct
from ..auditing.usable import MOCAP, MOTORS, usable
from ..flight import Flight, Span, intersect_spans
from ..metrics import tracking
from ..metrics.statistics import Summary
from ..metrics.timing import constant_delay
from ..metrics.trajectory import rms
from ..results.result import INLINE, OPTIONAL, Result, named
from ..settings import count, number
from ..signals.radio_gaps import radio_gaps
from .phases import is_cut, streamed_phase
from .score_tables import summaries
from .sessions import Drawn

RATIO, LAG_S, GAP_M = 0.10, 0.030, 0.05
"""A flight passes within these."""
SHARE = 0.85
"""Of flights whose RMSE ratio has to be within RATIO, of each controller."""
NEEDED = {"mocap": MOCAP, "setpoint": ("x", "y", "z"), "motor": MOTORS, "battery": ("vbat",),
          "estimator": ("x", "y", "z", "vx", "vy", "vz"), "attitude_qw": ("qx", "qy", "qz", "qw"),
          "imu": ("gyro_x", "gyro_y", "gyro_z")}
FLOWN = ("pid", "mellinger")
BY_REPORTED_NAME = {**{name: name for name in FLOWN}, "onboard_pid": "pid", "onboard_mellinger": "mellinger"}
"""Who flew, as the audit finds it or ``nanobench fly`` writes it -> the firmware's controller."""
MINIMUM_S = number("tasks.gate.minimum_s")
ROSE_M = number("tasks.gate.rose_m")
AVERAGED = ("lag_diff_s", "lag_real_s", "lag_sim_s", "path_gap_m", "rmse_real_m", "rmse_sim_m")
TICK_S = 0.01
MOST_LAG_S = 1.0
BANDS_HZ = ((0.3, 3.0), (3.0, 20.0))
PWM_OFF = 0.025
"""Minimum difference of the mean PWM that is reported for a failing flight."""
LEVEL_M = number("tasks.gate.level_m")
LEVEL_TICKS = count("tasks.gate.level_ticks")
"""PWM is compared where both vehicles are at one height, if that is so for so long."""
SHOWN_S = 0.1
STILL_M = number("tasks.gate.still_m")
PLANNED_M_S = number("tasks.gate.planned_m_s")


@dataclass(frozen=True, repr=False)
class GateRow(Result):
    """One repeated flight: measured (``real``) and simulated (``sim``), SI.

    ``pwm_mean``: PWM ratio (flown, simulated) at one height. ``pwm_rms``: the same by frequency band. ``reason``: the
    failed quantities, empty for a pass. ``clock_evidence``: streams that set the clock of the recording.
    """

    flight: str
    controller: str
    duration_s: float
    synthetic: bool
    rmse_real_m: float
    rmse_sim_m: float
    ratio: float
    lag_real_s: float
    lag_sim_s: float
    lag_diff_s: float
    path_gap_m: float
    z_bias_real_m: float
    z_bias_sim_m: float
    saturated_real_percent: float
    saturated_sim_percent: float
    pwm_mean: tuple[float, float] | None
    pwm_rms: Mapping[str, tuple[float, float]]
    passed: bool = field(default=True, metadata=named("pass"))
    reason: str = ""
    clock: str = field(default="", metadata=OPTIONAL)
    clock_evidence: Sequence[str] | None = field(default=None, metadata=OPTIONAL)


@dataclass(frozen=True, repr=False)
class GateSummary(Result):
    """Summary over n flights of one controller, or all.

    Shares of flights that pass as a whole and in each quantity, medians, and whether the aim is reached. The aim is
    the RMSE ratio on SHARE of flights, the median lag difference and the median gap. ``statistics``: intervals of
    shares and means. ``off``: absolute differences.
    """

    n: int
    drawn: Drawn | None = field(metadata=INLINE)
    statistics: Mapping[str, Summary]
    pass_share: float
    ratio_share: float
    lag_share: float
    gap_share: float
    ratio_median: float
    ratio_off_median: float
    ratio_off_p90: float
    lag_diff_median_s: float
    lag_off_median_s: float
    path_gap_median_m: float
    path_gap_p90_m: float
    aim: bool


@dataclass(frozen=True, repr=False)
class FlownAgain(Result):
    """Rows of the gate, and by name of the flight the simulated path [[s, x, y, z, qx, qy, qz, qw]]."""

    rows: list[GateRow]
    paths: dict[str, list[list[float]]]


@dataclass(frozen=True, repr=False)
class PicturedFlight(Result):
    """One flight and its simulation at 10 Hz: time_s (k,), positions (k, 3) m."""

    flight: str
    controller: str
    synthetic: bool
    time_s: np.ndarray
    reference_m: np.ndarray
    real_m: np.ndarray
    simulated_m: np.ndarray


@dataclass(frozen=True)
class Case:
    """One recording, who flew it, the span that is flown again, and when the radio was silent."""

    flight: Flight
    controller: str
    span: Span
    silent: tuple[Span, ...] = ()

    @property
    def ticks(self) -> int:
        return int(self.span.duration_s / TICK_S)

    @property
    def time_s(self) -> np.ndarray:
        """(m,) s from the first row of the recording, every 10 ms."""
        return self.span.start_s + TICK_S * np.arange(self.ticks)


def select(flights: Sequence[Flight], audits: Mapping[str, Audit], trained: Sequence[tuple[float, float]] = (),
           recorded: Sequence[Flight] = ()) -> tuple[list[Case], dict[str, str]]:
    """(cases, reason by name of the recordings left out).

    ``trained``: (start, end) in Unix time of the recordings that identified the plant; overlapping ones may not judge
    it. ``recorded``: the flights on their original clock, if ``flights`` are on another one; radio gaps are read there.
    Copies and slices are left out.
    """
    kept, repeats = distinct(flights)
    stamped = {f.name: f for f in (*flights, *recorded)}
    reasons = {r.flight.name: f"{r.kind} of {r.of.name}" for r in repeats}
    fit = {f.name: f for f in usable(kept, audits, NEEDED)}
    cases = []
    for flight in kept:
        audit = audits.get(flight.name)
        whole = fit.get(flight.name)
        if audit is None or whole is None:
            reasons[flight.name] = "lacks a stream the gate needs"
        elif audit.controller not in BY_REPORTED_NAME:
            reasons[flight.name] = f"flown by {audit.controller}, which is not a controller of the firmware"
        elif (setpoint_kind := flight.metadata.get("setpoints", "position")) != "position":
            reasons[flight.name] = f"flown by setpoints of {setpoint_kind}, not of positions"
        elif any(_overlaps(flight, begin, end) for begin, end in trained):
            reasons[flight.name] = "the plant was identified from it"
        else:
            span = _span(whole, audit)
            if span is None:
                reasons[flight.name] = f"less than {MINIMUM_S:g} s in the air with a log"
            elif not is_cut(whole) and np.ptp(whole["mocap"]["pz"]) < ROSE_M:
                reasons[flight.name] = f"never rose {ROSE_M:g} m: all in ground effect"
            else:
                gaps = tuple(radio_gaps(stamped[flight.name]))
                cases.append(Case(whole, BY_REPORTED_NAME[audit.controller], span, gaps))
    return cases, reasons


def _overlaps(flight: Flight, begin: float, end: float) -> bool:
    time_s = flight["mocap"].time_s
    return flight.epoch_s + float(time_s[0]) < end and flight.epoch_s + float(time_s[-1]) > begin


def _span(flight: Flight, audit: Audit) -> Span | None:
    """First to last in the air where the log is alive; a piece cut to the flight has been in the air all the time."""
    if not audit.airborne:
        return None
    air = Span(audit.airborne[0].start_s, audit.airborne[-1].end_s)
    if is_cut(flight):
        air = audit.span
    within = Span(max(flight[n].time_s[0] for n in NEEDED), min(flight[n].time_s[-1] for n in NEEDED))
    alive = intersect_spans(intersect_spans([air], [within]), audit.clean_for(NEEDED, cutting_logs()))
    first = alive[0] if alive else None
    return first if first is not None and first.duration_s >= MINIMUM_S else None


def setpoints(case: Case) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Reference of the controller at ``case.time_s``: position (m, 3), yaw (m,), velocity (m, 3).

    A streamed setpoint has no velocity. The planner's (take-off and landing) has: it is taken from the logged height
    while x and y stay constant before and after the stream. The yaw is the one logged in the PID group, else 0.
    """
    t, flight = case.time_s, case.flight
    place = flight["setpoint"].interpolate(("x", "y", "z"), t)
    yaw = np.zeros(len(t))
    if case.controller == "pid" and "pid" in flight and "yaw" in flight["pid"]:
        yaw = flight["pid"].interpolate("yaw", t)
    velocity = np.zeros((len(t), 3))
    moving = np.flatnonzero(np.abs(np.diff(place[:, :2], axis=0)).max(axis=1) > STILL_M)
    planned = np.ones(len(t), bool)
    if len(moving):
        planned[moving[0]:moving[-1] + 1] = False
    climb = np.gradient(place[:, 2], TICK_S)
    velocity[:, 2] = np.where(planned & (np.abs(climb) < PLANNED_M_S), climb, 0.0)
    return place, yaw, velocity


def score(case: Case, position_m: np.ndarray, motor: np.ndarray) -> GateRow:
    """Row of the gate: simulated position (m, 3) and PWM ratios (m, 4) at ``case.time_s`` against the recording."""
    t = case.time_s
    real = case.flight["mocap"].interpolate(("px", "py", "pz"), t)
    commanded = case.flight["setpoint"].interpolate(("x", "y", "z"), t)
    flown = case.flight["motor"].interpolate(MOTORS, t)
    rmse = [rms(tracking.position_errors(p, commanded)) for p in (real, position_m)]
    lag = [constant_delay(t, p, t, commanded, MOST_LAG_S).delay_s for p in (real, position_m)]
    gap = float(np.median(tracking.position_errors(position_m, real)))
    steady = _streamed(case)
    level = steady & (np.abs(position_m[:, 2] - real[:, 2]) < LEVEL_M)
    bias = [float(np.mean((p - commanded)[steady, 2])) for p in (real, position_m)]
    full = [tracking.saturated_percent(u) for u in (flown, motor)]
    row = GateRow(
        case.flight.name, case.controller, case.ticks * TICK_S, case.flight.provenance.synthetic,
        rmse_real_m=rmse[0], rmse_sim_m=rmse[1], ratio=rmse[1] / rmse[0],
        lag_real_s=lag[0], lag_sim_s=lag[1], lag_diff_s=lag[1] - lag[0], path_gap_m=gap,
        z_bias_real_m=bias[0], z_bias_sim_m=bias[1], saturated_real_percent=full[0], saturated_sim_percent=full[1],
        pwm_mean=(float(flown[level].mean()), float(motor[level].mean())) if level.sum() > LEVEL_TICKS else None,
        pwm_rms={f"{low:g}-{high:g} Hz": (_band(flown, low, high), _band(motor, low, high)) for low, high in BANDS_HZ})
    reason = reason_of(row)
    return replace(row, passed=not reason, reason=reason)


def pictured(rows: Sequence[GateRow], cases: Sequence[Case],
             flown: Mapping[str, Sequence[Sequence[float]]]) -> list[PicturedFlight]:
    """Of each controller the flight with the median gap and the one with the largest; ``flown``: [s, x, y, z, ...] by
    name of the flight."""
    found, by_name = [], {case.flight.name: case for case in cases}
    for name in FLOWN:
        mine = sorted((row for row in rows if row.controller == name and row.flight in flown),
                      key=lambda row: row.path_gap_m)
        for row in [mine[i] for i in sorted({len(mine) // 2, len(mine) - 1})] if mine else []:
            path = np.array(flown[row.flight], float)
            path = path[::max(1, round(SHOWN_S / (path[1, 0] - path[0, 0])))]
            t, flight = path[:, 0], by_name[row.flight].flight
            real = flight["mocap"].interpolate(("px", "py", "pz"), t)
            commanded = flight["setpoint"].interpolate(("x", "y", "z"), t)
            found.append(PicturedFlight(row.flight, name, flight.provenance.synthetic, np.round(t - t[0], 2),
                                        *(np.round(x, 4) for x in (commanded, real, path[:, 1:4]))))
    return found


def reason_of(row: GateRow) -> str:
    """Which quantity fails and by how much; empty for a flight that passes."""
    parts, word = [], "SYNTHETIC" if row.synthetic else "real"
    if not abs(row.ratio - 1.0) <= RATIO:
        parts.append(f"RMSE {row.rmse_sim_m:.3f} m simulated, {row.rmse_real_m:.3f} m {word}: "
                     f"{100.0 * (row.ratio - 1.0):+.0f} %, allowed {100.0 * RATIO:.0f}")
    if not abs(row.lag_diff_s) <= LAG_S:
        parts.append(f"lag {1e3 * row.lag_sim_s:.0f} ms simulated, {1e3 * row.lag_real_s:.0f} ms {word}: "
                     f"{1e3 * row.lag_diff_s:+.0f} ms, allowed {1e3 * LAG_S:.0f}")
    if not row.path_gap_m < GAP_M:
        parts.append(f"paths {100.0 * row.path_gap_m:.1f} cm apart, allowed {100.0 * GAP_M:.0f}")
    if parts and row.pwm_mean:
        flown, simulated = row.pwm_mean
        if abs(simulated - flown) > PWM_OFF * flown:
            parts.append(f"motors at {100.0 * simulated:.1f} % simulated, {100.0 * flown:.1f} % {word}, at the same "
                         f"height: the plant lifts {'less' if simulated > flown else 'more'}")
    return "; ".join(parts)


def _streamed(case: Case) -> np.ndarray:
    """(m,) bool: the path is streamed, or, where none was, all."""
    phase = streamed_phase(case.flight, [case.span])
    t = case.time_s
    return np.ones(len(t), bool) if phase is None else (t >= phase.start_s) & (t <= phase.end_s)


def _band(motor: np.ndarray, low_hz: float, high_hz: float) -> float:
    """RMS over the four motors of the PWM ratio between two frequencies."""
    frequency, density = welch(motor, 1.0 / TICK_S, nperseg=min(512, len(motor)), axis=0)
    rows = (frequency >= low_hz) & (frequency < high_hz)
    return float(np.sqrt(np.mean(density[rows].sum(axis=0)) * (frequency[1] - frequency[0])))


def summary(rows: Sequence[GateRow], sessions: Mapping[str, int] | None = None,
            seed: int = 0) -> dict[str, GateSummary]:
    """Of each controller that flew, and of ``all``. sessions: label of every flight, by name."""
    found: dict[str, GateSummary] = {}
    for name in (*FLOWN, "all"):
        mine = [row for row in rows if name in ("all", row.controller)]
        if not mine:
            continue
        ratio, lag, gap = np.array([(row.ratio, row.lag_diff_s, row.path_gap_m) for row in mine]).T
        off, late = np.abs(ratio - 1.0), np.abs(lag)
        passed = {"pass_share": np.array([row.passed for row in mine]), "ratio_share": off <= RATIO,
                  "lag_share": late <= LAG_S, "gap_share": gap < GAP_M}
        labels = None if sessions is None else np.array([sessions[row.flight] for row in mine])
        statistics = summaries([{**{key: values[i] for key, values in passed.items()},
                                 **{key: getattr(row, key) for key in AVERAGED}} for i, row in enumerate(mine)], seed,
                               labels)
        shares = {key: float(values.mean()) for key, values in passed.items()}
        found[name] = GateSummary(
            len(mine), None if labels is None else Drawn.of(labels, statistics), statistics, **shares,
            ratio_median=float(np.median(ratio)), ratio_off_median=float(np.median(off)),
            ratio_off_p90=float(np.quantile(off, 0.9)), lag_diff_median_s=float(np.median(lag)),
            lag_off_median_s=float(np.median(late)), path_gap_median_m=float(np.median(gap)),
            path_gap_p90_m=float(np.quantile(gap, 0.9)),
            aim=bool(shares["ratio_share"] >= SHARE and abs(np.median(lag)) <= LAG_S and np.median(gap) < GAP_M))
    return found

"""The time error of a flight's firmware clock: inferred from its streams, and believed only if others confirm it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from ..clock.reading import ClockReading
from ..clock.readings import read_clocks
from ..content.airborne import airborne_spans
from ..content.context import Context
from ..content.truth import truth_of
from .chain import add_student_evidence, posterior
from .delivery import CELL_S, log_step_prior, log_steps_from_odometry
from .evidence import ALIKE_S, KINDS, Evidence, collect
from .warp import ClockWarp

ROW_S = 0.01
FIRST_STATE, LAST_STATE = round(-0.25 / CELL_S), round(0.30 / CELL_S)
"""The delay is sought within -250..+300 ms, three times the largest excursion seen on real links."""

PRIOR_SD_S, PRIOR_WEIGHT = 0.05, 1.0 / 30.0
"""Where motion shows nothing the delay returns to its median within some 50 ms; one vote per 0.3 s, over which it
forgets its past."""

TYPICAL_LAG_S = {"gyro": 0.0, "acceleration": 0.015, "attitude": 0.01, "velocity": 0.005, "position": 0.022}
"""Lags of the firmware's streams behind its gyro, medians of real flights; used for the first of ANCHORS present."""

ANCHORS = ("gyro", "attitude", "velocity", "position", "acceleration")

SLOWEST_M_S = 0.2
"""Slower than this a vehicle shows no time error through its position."""

INERTIAL_INFLATION = 1.5
"""The posterior of a clock from gyro and accelerometer alone is too sure by this factor on practice flights."""

BLOCK_S = 2.0
PASSES = 4


def infer(context: Context, kinds: tuple[str, ...] = tuple(KINDS), odometry: bool = True, causal: bool = False,
          begin: ClockWarp | None = None) -> ClockWarp | None:
    """The warp that the streams ``kinds`` show, believed as it is; None without motion capture, flight or evidence.

    ``odometry``: also use how far the estimator's position moves against its velocity (needs no motion capture).
    ``causal``: the value at t uses nothing later than t but the learnt noise and lags.
    ``begin``: a warp found from fewer streams; half the passes are enough from there.
    """
    airborne = context.once(airborne_spans)
    if not airborne:
        return None
    start, end = airborne[0].start_s - 0.3, airborne[-1].end_s + 0.3
    evidence = collect(context, kinds, start, end)
    if not evidence:
        return None
    end = min(end, max(float(e.time_s[-1]) for e in evidence))
    rows_s = np.arange(start, end, ROW_S)
    if len(rows_s) < 100:
        return None
    steps_s, prior, up = log_step_prior(ROW_S)
    transition = np.tile(prior, (len(rows_s), 1))
    if odometry:
        transition = transition + _odometry(context, rows_s, steps_s, causal)
    states_s = np.arange(FIRST_STATE, LAST_STATE + 1) * CELL_S
    # lags are learnt against a delay that the stream itself did not vote for, else they are drawn towards the old one
    leading = [e for e in evidence if KINDS[e.kind].group == "estimator"] or evidence
    delay = np.zeros(len(rows_s)) if begin is None else begin.at(rows_s)
    sd = np.zeros(len(rows_s))
    first = 0 if begin is None else PASSES // 2
    for number in range(first, PASSES):
        for e in evidence:
            e.learn_lag(np.interp(e.time_s, rows_s, delay), near=number > max(first, 1))
        _gauge(evidence, delay)
        likelihood = np.empty((len(rows_s), len(states_s)))
        likelihood[:] = -0.5 * PRIOR_WEIGHT * ((states_s - np.median(delay)) / PRIOR_SD_S) ** 2
        for e in evidence if number == PASSES - 1 else leading:
            at_samples = np.interp(e.time_s, rows_s, delay)
            if number:  # under the first constant the residual is the wander itself, not the noise
                e.learn_noise(at_samples)
            _vote(likelihood, e, rows_s, at_samples)
        p = posterior(likelihood, transition, up, causal and number == PASSES - 1)
        delay = p @ states_s
        sd = np.sqrt(np.maximum(p @ states_s**2 - delay**2, 0.0) + CELL_S**2 / 12.0)
    widened = INERTIAL_INFLATION if leading is evidence else 1.0
    sd = np.hypot(sd * widened, _slow_error_s(context, evidence, rows_s, delay))
    moving = _speed(context, rows_s) > SLOWEST_M_S
    constant = float(np.median(delay[moving])) if moving.any() else float(np.median(delay))
    wander = float(np.std(delay[moving])) if moving.any() else 0.0
    return ClockWarp(rows_s, delay, sd, constant, wander, True, {e.kind: e.lag_s for e in evidence},
                     "time error from " + ", ".join(e.kind for e in evidence))


def _gauge(evidence: list[Evidence], delay: np.ndarray) -> None:
    """Delay and lags are known up to a constant: the anchor's lag is made 0, in place."""
    anchor = next((e for kind in ANCHORS for e in evidence if e.kind == kind), None)
    if anchor is None:
        return
    shift = anchor.lag_s - TYPICAL_LAG_S[anchor.kind]
    delay += shift
    for e in evidence:
        e.lag_s -= shift


def _vote(likelihood: np.ndarray, e: Evidence, rows_s: np.ndarray, delay_s: np.ndarray) -> None:
    row = np.round((e.time_s - rows_s[0]) / ROW_S).astype(np.int64)
    inside = (row >= 0) & (row < len(rows_s))
    per_row = min(1.0, float(np.median(np.diff(e.time_s))) / ROW_S)  # several samples in a row share one vote
    add_student_evidence(likelihood, row[inside], e.cells()[inside], e.predicted,
                         np.ascontiguousarray(e.detrended(delay_s)[inside]), e.sigma, e.weight * per_row, FIRST_STATE)


def _odometry(context: Context, rows_s: np.ndarray, steps_s: np.ndarray, causal: bool) -> np.ndarray:
    flight = context.flight
    if "estimator" not in flight or not {"x", "y", "z", "vx", "vy", "vz"} <= set(flight["estimator"].quantities):
        return np.zeros((len(rows_s), len(steps_s)))
    s = flight["estimator"]
    return log_steps_from_odometry(steps_s, rows_s, s.interpolate(("x", "y", "z"), rows_s),
                                   s.interpolate(("vx", "vy", "vz"), rows_s), causal)


def _speed(context: Context, rows_s: np.ndarray) -> np.ndarray:
    """(n,) speed of the vehicle [m/s] at the rows."""
    truth = context.once(truth_of)
    return np.interp(rows_s, truth.time_s, np.linalg.norm(truth.velocity_m_s, axis=1))


def _slow_error_s(context: Context, evidence: list[Evidence], rows_s: np.ndarray, delay: np.ndarray) -> np.ndarray:
    """(n,) s: what a slow error of the estimator's position along the track passes off as time.

    Along the track it cannot be told from time; its size is read across the track, where time cannot act.
    """
    position = next((e for e in evidence if e.kind == "position"), None)
    if position is None:
        return np.zeros(len(rows_s))
    truth = context.once(truth_of)
    residual = position.residual(np.interp(position.time_s, rows_s, delay))
    v = np.stack([np.interp(position.time_s, truth.time_s, truth.velocity_m_s[:, k]) for k in range(3)], axis=1)
    speed = np.linalg.norm(v, axis=1, keepdims=True)
    across = residual - v * np.sum(residual * v, axis=1, keepdims=True) / np.maximum(speed, SLOWEST_M_S) ** 2
    across = across[speed[:, 0] > SLOWEST_M_S]
    if len(across) < 100:
        return np.zeros(len(rows_s))
    slow = uniform_filter1d(across, max(1, round(ALIKE_S / ROW_S)), axis=0)
    sigma_m = np.median(np.linalg.norm(slow, axis=1)) / 1.1774  # two components remain: median of a Rayleigh variable
    return sigma_m / np.maximum(_speed(context, rows_s), SLOWEST_M_S)


def gain_on(context: Context, warp: ClockWarp, kind: str) -> tuple[float, float]:
    """Share of the residual variance of stream ``kind`` that ``warp`` removes against the best constant, and its
    standard error over blocks of BLOCK_S. Both clocks get their own best lag, so a constant cannot win or lose."""
    if not len(warp.time_s):
        return 0.0, float("inf")
    judged = collect(context, (kind,), float(warp.time_s[0]), float(warp.time_s[-1]))
    if not judged:
        return 0.0, float("inf")
    squared = []
    for delay in (np.full(len(judged[0].time_s), warp.constant_s), warp.at(judged[0].time_s)):
        judged[0].learn_lag(delay)
        squared.append(np.sum(judged[0].residual(delay) ** 2, axis=1))
    limit = 9.0 * min(np.median(s) for s in squared)
    before, after = (np.minimum(s, limit) for s in squared)
    block = ((judged[0].time_s - judged[0].time_s[0]) / BLOCK_S).astype(int)
    count = np.bincount(block)
    keep = count > 0
    difference = np.bincount(block, before - after)[keep] / before.mean() / count[keep].mean()
    n = len(difference)
    return float(difference.mean()), float(difference.std(ddof=1) / np.sqrt(n)) if n > 2 else float("inf")


def believed(context: Context, kinds: tuple[str, ...] = tuple(KINDS)) -> ClockWarp | None:
    """The warp of the evidence ``kinds`` if a stream that did not set it confirms it, else the constant offset of the
    gyro with the reason; None where not even that is identifiable.

    The clock read from one group of streams must make a stream outside of the group agree better with the motion
    capture (``gain_on``) by more than twice its standard error.
    """
    found = {e.kind for e in collect(context, tuple(KINDS), -np.inf, np.inf)}
    have = tuple(k for k in kinds if k in found)
    pairs = ((tuple(k for k in have if KINDS[k].group == "estimator"), ("gyro", "acceleration")),
             (tuple(k for k in have if KINDS[k].group == "inertial"), ("attitude", "velocity", "position")),
             (("gyro",) if "gyro" in have else (), ("acceleration",)))
    chosen = next(((source, judge) for source, judges in pairs for judge in judges if source and judge in found), None)
    trial = None if chosen is None else infer(context, chosen[0])
    reading = read_clocks(context).get("imu")
    if chosen is None or trial is None:
        return _constant(reading, trial, "no second stream that could confirm a moving error")
    source, judge = chosen
    gain, error = gain_on(context, trial, judge)
    change = f"the clock from {', '.join(source)}"
    if not gain > 2.0 * error:
        return _constant(reading, trial, f"no moving error confirmed: {change} changes the residual of the {judge}, "
                                         f"which it never saw, by {-100 * gain:.0f} % +- {196 * error:.0f}")
    every = trial if set(have) == set(source) else infer(context, have, begin=trial)
    if every is None:
        return None
    return replace(every, reason=f"moves by {1e3 * every.wander_sd_s:.1f} ms (SD); {change} lowers the residual of the "
                                 f"{judge}, which it never saw, by {100 * gain:.0f} % +- {196 * error:.0f}")


def _constant(reading: ClockReading | None, trial: ClockWarp | None, reason: str) -> ClockWarp | None:
    if reading is None or not reading.identifiable:
        return None
    rows_s = np.zeros(0) if trial is None else trial.time_s
    sd = (reading.ci95_s[1] - reading.ci95_s[0]) / 3.92 if reading.ci95_s else float("inf")
    return ClockWarp(rows_s, np.full(len(rows_s), reading.offset_s), np.full(len(rows_s), sd), reading.offset_s, 0.0,
                     False, {}, f"{reason}; the constant is used")

"""Time error of one clock over time, from everything that another clock can predict: posterior of a hidden Markov
chain.

``smooth_delay`` is the inference; ``infer`` gathers the evidence of a flight and calls it. ``confirm`` decides whether
to accept the result.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from ...settings import count, number, setting
from ...signals.airborne import airborne_spans
from ...signals.context import Context
from ...signals.mocap_derivatives import derivatives_of
from ..mathematics.hmm import add_student_evidence, log_evidence, posterior
from ..mathematics.packet_delay import CELL_S, log_step_prior
from .evidence import ALIKE_S, KINDS, Evidence, collect
from .steps import log_likelihood_of_steps
from .time_offset import TimeOffset, wander_of

ROW_S = 0.01
EARLIEST_S, LATEST_S = number("retiming.infer.earliest_s"), number("retiming.infer.latest_s")
FIRST_STATE, LAST_STATE = round(EARLIEST_S / CELL_S), round(LATEST_S / CELL_S)
"""The delay is sought within -250..+300 ms, three times the largest excursion seen on real links."""

PRIOR_SD_S, PRIOR_WEIGHT = number("retiming.infer.prior_sd_s"), number("retiming.infer.prior_weight")
"""Where motion shows nothing the delay returns to its median within some 50 ms; one vote per 0.3 s, over which it
forgets its past."""

ANCHORS = ("gyro", "attitude", "velocity", "position", "acceleration")
"""Delay and lags are known up to a constant: the first of these that is present has its typical lag."""

SLOWEST_M_S = number("retiming.infer.slowest_m_s")

INFLATION = number("retiming.infer.inflation")

RATES: tuple[float, ...] = setting("retiming.infer.rates")

PASSES = count("retiming.infer.passes")
BESIDE_S = number("retiming.infer.beside_s")
FEWEST = count("retiming.infer.fewest")


def infer(context: Context, kinds: tuple[str, ...] = tuple(KINDS), causal: bool = False,
          begin: TimeOffset | None = None) -> TimeOffset | None:
    """The warp that the streams ``kinds`` show, believed as it is; None without motion capture, flight or evidence.

    No other stream is used. Two of them also show how the delay moves where one is the other's rate
    (``steps.STEP_KINDS``, needs no motion capture). ``causal``: the value at t uses the flight up to t + 0.06 s. The
    derivatives of the poses need these. Noise and lags are then the typical ones, because learning them takes
    the whole flight. Streams whose slow part has to be removed are left out. ``begin``: a warp found from fewer
    streams; half the passes are enough from there.
    """
    airborne = context.once(airborne_spans)
    if not airborne:
        return None
    start, end = airborne[0].start_s - BESIDE_S, airborne[-1].end_s + BESIDE_S
    evidence = [e for e in collect(context, kinds, start, end) if not (causal and e.kind.detrended)]
    if not evidence:
        return None
    rows_s = np.arange(start, min(end, max(float(e.time_s[-1]) for e in evidence)), ROW_S)
    if len(rows_s) < FEWEST:
        return None
    voting = tuple(e.kind.name for e in evidence)

    def likely(steps_s: np.ndarray) -> np.ndarray | None:
        return log_likelihood_of_steps(context, voting, rows_s, steps_s, causal)

    if causal:
        delay, sd, ratio = filter_delay(evidence, rows_s, likely)
    else:
        delay, sd, ratio = smooth_delay(evidence, rows_s, likely, begin)
    sd = np.hypot(sd * (1.0 if "position" in voting else INFLATION),
                  _slow_error_s(context, evidence, rows_s, delay))
    moving = _speed(context, rows_s) > SLOWEST_M_S
    seen = moving if moving.any() else np.ones(len(rows_s), bool)
    return TimeOffset(rows_s, delay, sd, float(np.median(delay[seen])), wander_of(rows_s[seen], delay[seen]), True,
                     {e.kind.name: e.lag_s for e in evidence}, "time error from " + ", ".join(voting), voting, ratio)


Steps = Callable[[np.ndarray], np.ndarray | None]
"""Steps of the delay [s] (b,) -> (n, b) log likelihood of each at each row, or None where nothing is known of them."""


@dataclass(frozen=True)
class Grid:
    """The candidate delays, ``stride`` cells apart, and their transitions: log_transition (n, b) and ``up`` as in
    ``hmm.posterior``. ``log_prior`` (b,): its part without evidence."""

    stride: int
    first: int
    states_s: np.ndarray
    log_transition: np.ndarray
    log_prior: np.ndarray
    up: int

    @classmethod
    def of(cls, rows_s: np.ndarray, likely: Steps, stride: int) -> Grid:
        first, last = FIRST_STATE // stride, LAST_STATE // stride
        steps_s, prior, up = log_step_prior(ROW_S, stride * CELL_S)
        known = likely(steps_s)
        moves = np.tile(prior, (len(rows_s), 1)) if known is None else known + prior
        return cls(stride, first, np.arange(first, last + 1) * stride * CELL_S, moves, prior, up)


def smooth_delay(evidence: list[Evidence], rows_s: np.ndarray, likely: Steps,
                 begin: TimeOffset | None = None) -> tuple[np.ndarray, np.ndarray, float]:
    """(n,) posterior mean and standard deviation of the delay [s] at ``rows_s``. Also the logarithm of the likelihood
    ratio of a moving delay to a constant one. Learns lag, noise and weight of every member of ``evidence`` in place.
    All passes but the last are on a coarse grid."""
    # lags are learnt against a delay that the stream itself did not vote for, else they are drawn towards the old one
    leading = [e for e in evidence if e.kind.group == "estimator"] or evidence
    delay = np.zeros(len(rows_s)) if begin is None else begin.at(rows_s)
    sd, ratio = np.zeros(len(rows_s)), float("nan")
    first = 0 if begin is None else PASSES // 2
    coarse, fine = Grid.of(rows_s, likely, 2), Grid.of(rows_s, likely, 1)
    for turn in range(first, PASSES):
        for e in evidence:
            e.learn_lag(np.interp(e.time_s, rows_s, delay), near=turn > max(first, 1))
            e.learn_bias(np.interp(e.time_s, rows_s, delay))
        _gauge(evidence, delay)
        voting = evidence if turn == PASSES - 1 else leading
        if turn:  # under the first constant the residual is the wander itself, not the noise
            for e in voting:
                e.learn_noise(np.interp(e.time_s, rows_s, delay))
        last = turn == PASSES - 1
        delay, sd, ratio = _posterior(voting, rows_s, fine if last else coarse, delay, False, compare=last)
    return delay, sd, ratio


def filter_delay(evidence: list[Evidence], rows_s: np.ndarray, likely: Steps) -> tuple[np.ndarray, np.ndarray, float]:
    """As ``smooth_delay``, but each row uses only what came before it, with typical lags and noise."""
    for e in evidence:
        e.lag_s = e.kind.typical_lag_s
        e.sigma = np.full(e.measured.shape[1], e.kind.typical_sigma)
        e.weight = e.kind.typical_weight
    return _posterior(evidence, rows_s, Grid.of(rows_s, likely, 1), np.zeros(len(rows_s)), True)


def _posterior(evidence: list[Evidence], rows_s: np.ndarray, grid: Grid, delay: np.ndarray,
               causal: bool, compare: bool = False) -> tuple[np.ndarray, np.ndarray, float]:
    likelihood = np.empty((len(rows_s), len(grid.states_s)))
    likelihood[:] = -0.5 * PRIOR_WEIGHT * ((grid.states_s - np.median(delay)) / PRIOR_SD_S) ** 2
    for e in evidence:
        _vote(likelihood, e, rows_s, np.interp(e.time_s, rows_s, delay), grid)
    p = posterior(likelihood, grid.log_transition, grid.up, causal)
    mean = p @ grid.states_s
    sd = np.sqrt(np.maximum(p @ grid.states_s**2 - mean**2, 0.0) + (grid.stride * CELL_S) ** 2 / 12.0)
    return mean, sd, _log_ratio(likelihood, grid) if compare else float("nan")


def _log_ratio(likelihood: np.ndarray, grid: Grid) -> float:
    """Log likelihood ratio of all paths together to all constants together. The rate at which the delay moves is
    unknown (RATES). At the full rate alone, where steps are rare, a clock that moves rarely but far would lose to a
    constant one."""
    stay = grid.log_transition.shape[1] - 1 - grid.up
    known = grid.log_transition - grid.log_prior
    constants = np.logaddexp.reduce(likelihood.sum(axis=0)) - np.log(likelihood.shape[1]) + known[1:, stay].sum()
    paths = []
    for rate in RATES:
        prior = rate * np.exp(grid.log_prior)
        prior[stay] += 1.0 - rate
        paths.append(log_evidence(likelihood, known + np.log(prior), grid.up))
    return float(np.logaddexp.reduce(paths) - np.log(len(paths)) - constants)


def _gauge(evidence: list[Evidence], delay: np.ndarray) -> None:
    """The anchor's lag is made the typical one, all others and ``delay`` follow, in place."""
    anchor = next((e for name in ANCHORS for e in evidence if e.kind.name == name), evidence[0])
    shift = anchor.lag_s - anchor.kind.typical_lag_s
    delay += shift
    for e in evidence:
        e.lag_s -= shift


def _vote(likelihood: np.ndarray, e: Evidence, rows_s: np.ndarray, delay_s: np.ndarray, grid: Grid) -> None:
    row = np.round((e.time_s - rows_s[0]) / ROW_S).astype(np.int64)
    inside = (row >= 0) & (row < len(rows_s))
    per_row = min(1.0, float(np.median(np.diff(e.time_s))) / ROW_S)  # several samples in a row share one vote
    add_student_evidence(likelihood, row[inside], e.cells()[inside], e.predicted,
                         np.ascontiguousarray(e.detrended(delay_s)[inside]), e.sigma, e.weight * per_row,
                         grid.first, grid.stride)


def _speed(context: Context, rows_s: np.ndarray) -> np.ndarray:
    """(n,) speed of the vehicle [m/s] at the rows."""
    truth = context.once(derivatives_of)
    if truth is None:
        return np.zeros(len(rows_s))
    return np.asarray(np.interp(rows_s, truth.time_s, np.linalg.norm(truth.velocity_m_s, axis=1)))


def _slow_error_s(context: Context, evidence: list[Evidence], rows_s: np.ndarray, delay: np.ndarray) -> np.ndarray:
    """(n,) s: what a slow error of the estimator's position along the track passes off as time.

    Along the track it cannot be distinguished from time; its size is read across the track, where time cannot act.
    """
    position = next((e for e in evidence if e.kind.name == "position"), None)
    truth = context.once(derivatives_of)
    if position is None or truth is None:
        return np.zeros(len(rows_s))
    residual = position.residual(np.interp(position.time_s, rows_s, delay))
    v = np.stack([np.interp(position.time_s, truth.time_s, truth.velocity_m_s[:, k]) for k in range(3)], axis=1)
    speed = np.linalg.norm(v, axis=1, keepdims=True)
    across = residual - v * np.sum(residual * v, axis=1, keepdims=True) / np.maximum(speed, SLOWEST_M_S) ** 2
    across = across[speed[:, 0] > SLOWEST_M_S]
    if len(across) < FEWEST:
        return np.zeros(len(rows_s))
    slow = uniform_filter1d(across, max(1, round(ALIKE_S / ROW_S)), axis=0)
    sigma_m = np.median(np.linalg.norm(slow, axis=1)) / np.sqrt(2.0 * np.log(2.0))  # two components remain
    return np.asarray(sigma_m / np.maximum(_speed(context, rows_s), SLOWEST_M_S))

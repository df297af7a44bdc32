"""A moving time error is believed only if streams that did not set it confirm it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..clock.moving import OWN_LAG_S
from ..clock.reading import ClockReading
from ..clock.readings import read_clocks
from ..content.context import Context
from .evidence import KINDS, Evidence, collect
from .infer import infer
from .ticks import warp_from_ticks
from .warp import ClockWarp

BLOCK_S = 1.0
"""The time error and the noise of the streams have forgotten their past after a second: blocks are independent."""

JUDGES = {"estimator": (("gyro",), ("acceleration",)), "inertial": (("attitude", "velocity"), ("position",))}
"""Streams that may judge a clock set by the group; the first of them that the flight has. Accelerations show time so
weakly, and positions are so much what the inertial clock is wanted for, that they come last."""


def gain_on(context: Context, warp: ClockWarp, kind: str) -> tuple[float, float]:
    """Share of the residual variance of stream ``kind`` that ``warp`` removes against the best constant, and its
    standard error over blocks of BLOCK_S. Both clocks get their own best lag, so a constant cannot win or lose."""
    if not len(warp.time_s):
        return 0.0, float("inf")
    judged = collect(context, (kind,), float(warp.time_s[0]), float(warp.time_s[-1]))
    if not judged:
        return 0.0, float("inf")
    return evidence_gain(judged[0], warp.constant_s, warp.at(judged[0].time_s))


def evidence_gain(judged: Evidence, constant_s: float, delay_s: np.ndarray) -> tuple[float, float]:
    """``gain_on`` for one piece of evidence: ``delay_s`` (s,) at its samples against ``constant_s``."""
    squared = []
    for delay in (np.full(len(delay_s), constant_s), delay_s):
        judged.learn_lag(delay)
        squared.append(np.sum(judged.residual(delay) ** 2, axis=1))
    limit = 9.0 * min(np.median(s) for s in squared)
    before, after = (np.minimum(s, limit) for s in squared)
    block = ((judged.time_s - judged.time_s[0]) / BLOCK_S).astype(int)
    count = np.bincount(block)
    keep = count > 0
    difference = np.bincount(block, before - after)[keep] / max(before.mean(), 1e-30) / count[keep].mean()
    n = len(difference)
    return float(difference.mean()), float(difference.std(ddof=1) / np.sqrt(n)) if n > 2 else float("inf")


def believed(context: Context, kinds: tuple[str, ...] = tuple(KINDS)) -> ClockWarp | None:
    """The warp of the evidence ``kinds`` if streams that did not set it confirm it, else the constant offset of the
    gyro with the reason; None where not even that is identifiable. Where the firmware's ticks were logged the delay is
    measured, and nothing has to be inferred.

    The clock read from one group of streams must make streams outside of the group agree better with the motion
    capture (``gain_on``) by more than twice the standard error, all of them taken together.
    """
    measured = warp_from_ticks(context)
    if measured is not None:
        return measured
    reading = read_clocks(context).get("imu")
    found = {e.kind.name for e in collect(context, tuple(KINDS), -np.inf, np.inf)}
    have = tuple(k for k in kinds if k in found)
    trial, source = None, have
    judges: tuple[str, ...] = ()
    for group, choices in JUDGES.items():
        source = tuple(k for k in have if KINDS[k].group == group)
        judges = next((there for there in (tuple(k for k in names if k in found) for names in choices) if there), ())
        if source and judges:
            trial = infer(context, source)
            break
    if trial is None:
        return _constant(reading, trial, "no second stream that could confirm a moving error")
    names = ", ".join(source)
    gains = {judge: gain_on(context, trial, judge) for judge in judges}
    gain, error = _together(gains)
    told = " and ".join(f"{judge} {-100 * g:.0f} % +- {196 * e:.0f}" for judge, (g, e) in gains.items())
    said = f"the clock from {names} changes the residual of what it never saw: {told}"
    if not gain > 2.0 * error:
        return _constant(reading, trial, f"no moving error confirmed: {said}")
    every = trial if set(have) == set(source) else infer(context, have, begin=trial)
    if every is None:
        return None
    apart = _apart(every)
    if apart:
        return _constant(reading, trial, f"the streams do not share one clock: {apart}")
    return replace(every, reason=f"moves by {1e3 * every.wander_sd_s:.1f} ms (SD); {said}")


def _together(gains: dict[str, tuple[float, float]]) -> tuple[float, float]:
    """Mean of the judges' gains weighted by their certainty, and its standard error."""
    weight = np.array([1.0 / max(error, 1e-6) ** 2 for _, error in gains.values()])
    gain = np.array([g for g, _ in gains.values()])
    if not weight.sum() > 0.0:
        return 0.0, float("inf")
    return float(gain @ weight / weight.sum()), float(1.0 / np.sqrt(weight.sum()))


def _apart(warp: ClockWarp) -> str:
    """Which estimate comes before the gyro it was made of, or too long after it; empty when none does."""
    gyro = warp.lags_s.get("gyro")
    for name in ("position", "attitude"):  # a velocity's own lag has either sign
        if gyro is not None and name in warp.lags_s:
            behind = warp.lags_s[name] - gyro
            if not OWN_LAG_S[0] < behind < OWN_LAG_S[1]:
                return f"the {name} would come {1e3 * behind:.0f} ms after the gyro"
    return ""


def _constant(reading: ClockReading | None, trial: ClockWarp | None, reason: str) -> ClockWarp | None:
    if reading is None or not reading.identifiable:
        return None
    rows_s = np.zeros(0) if trial is None else trial.time_s
    sd = (reading.ci95_s[1] - reading.ci95_s[0]) / 3.92 if reading.ci95_s else float("inf")
    return ClockWarp(rows_s, np.full(len(rows_s), reading.offset_s), np.full(len(rows_s), sd), reading.offset_s, 0.0,
                     False, {}, f"{reason}; the constant is used")

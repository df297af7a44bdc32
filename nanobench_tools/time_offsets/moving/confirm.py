"""Whether a moving time error is believed: by how much likelier it makes the streams that voted, or by a stream that
did not."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...settings import number
from ...signals.context import Context
from ..constant.drift_and_wander import OWN_LAG_S
from ..constant.reading import ClockReading
from ..constant.readings import read_clocks
from .evidence import KINDS, Evidence, collect
from .infer import infer
from .sender_timestamps import time_offset_from_ticks
from .time_offset import TimeOffset

BLOCK_S = number("retiming.confirm.block_s")
LEAST_LOG_RATIO = number("retiming.confirm.least_log_ratio")

ESTIMATED, SENSED = ("attitude", "velocity", "position"), ("gyro", "acceleration")


def gain_on(context: Context, time_offset: TimeOffset, kind: str) -> tuple[float, float]:
    """Share of the residual variance of stream ``kind`` that ``time_offset`` removes against the best constant. Also
    its standard error over blocks of BLOCK_S. Both clocks get their own best lag, so a constant cannot win or lose."""
    if not len(time_offset.time_s):
        return 0.0, float("inf")
    judged = collect(context, (kind,), float(time_offset.time_s[0]), float(time_offset.time_s[-1]))
    if not judged:
        return 0.0, float("inf")
    return evidence_gain(judged[0], time_offset.constant_s, time_offset.at(judged[0].time_s))


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


def believed(context: Context, kinds: tuple[str, ...] = tuple(KINDS)) -> TimeOffset | None:
    """The warp of the evidence ``kinds`` where it is shown that something moves, else the constant offset of the gyro
    with the reason; None where not even that is identifiable. Where the firmware's ticks were logged the delay is
    measured, and nothing has to be inferred.

    Without the estimated position, a moving error has to explain the voting streams better than every constant does.
    Its freedom is counted, and noise alone must not explain the gain (``TimeOffset.log_ratio`` above LEAST_LOG_RATIO).
    No other stream is looked at. With it that does not suffice, as an error of the estimate looks like time along the
    track. The clock of the estimates alone must then make the gyro, which did not set it, agree better with the motion
    capture. The gain (``gain_on``) must exceed twice the standard error.
    """
    measured = time_offset_from_ticks(context)
    if measured is not None:
        return measured
    reading = context.once(read_clocks).get("imu")
    found = {e.kind.name for e in collect(context, kinds, -np.inf, np.inf)}
    have = tuple(kind for kind in kinds if kind in found)
    every, why = _confirmed(context, have) if "position" in have else _likelier(context, have)
    if every is None:
        return _constant(reading, (), why)
    if not every.moving:
        return _constant(reading, every.time_s, why)
    if apart := _apart(every):
        return _constant(reading, every.time_s, f"the streams do not share one clock: {apart}")
    return replace(every, reason=f"moves by {1e3 * every.wander_sd_s:.1f} ms (SD); {why}")


def _likelier(context: Context, have: tuple[str, ...]) -> tuple[TimeOffset | None, str]:
    """The time offset of ``have``, moving where it is likelier so than constant, and why."""
    time_offset = infer(context, have) if "gyro" in have else None  # an accelerometer shows time too weakly to be alone
    if time_offset is None:
        return None, "no gyro that the motion capture predicts"
    ratio = time_offset.log_ratio
    reason = f"{', '.join(have)} are likelier with a moving than with a constant clock by exp({ratio:.0f})"
    if ratio > LEAST_LOG_RATIO:
        return time_offset, reason
    return replace(time_offset, moving=False), (f"no moving error shown: {reason}; noise alone reaches "
                                                f"exp({LEAST_LOG_RATIO:.0f})")


def _confirmed(context: Context, have: tuple[str, ...]) -> tuple[TimeOffset | None, str]:
    """The time offset of ``have``, moving where a stream that did not set the trial confirms it, and why."""
    source = tuple(kind for kind in have if kind in ESTIMATED)
    judges = tuple(kind for kind in have if kind in SENSED)[:1]
    trial = infer(context, source) if judges else None
    if trial is None:
        return None, "no second stream that could confirm a moving error"
    gain, error = gain_on(context, trial, judges[0])
    evidence_note = (f"the clock from {', '.join(source)} changes the residual of what it never saw: {judges[0]} "
            f"{-100 * gain:.0f} % +- {196 * error:.0f}")
    if not gain > 2.0 * error:
        return replace(trial, moving=False), f"no moving error confirmed: {evidence_note}"
    every = infer(context, have, begin=trial)
    return every, evidence_note


def _apart(time_offset: TimeOffset) -> str:
    """Which estimate comes before the gyro it was made of, or too long after it; empty when none does."""
    gyro = time_offset.lags_s.get("gyro")
    for name in ("position", "attitude"):  # a velocity's own lag has either sign
        if gyro is not None and name in time_offset.lags_s:
            behind = time_offset.lags_s[name] - gyro
            if not OWN_LAG_S[0] < behind < OWN_LAG_S[1]:
                return f"the {name} would come {1e3 * behind:.0f} ms after the gyro"
    return ""


def _constant(reading: ClockReading | None, rows_s: Sequence[float] | np.ndarray, reason: str) -> TimeOffset | None:
    if reading is None or not reading.identifiable:
        return None
    time_s = np.asarray(rows_s, float)
    sd = (reading.ci95_s[1] - reading.ci95_s[0]) / 3.92 if reading.ci95_s else float("inf")
    return TimeOffset(time_s, np.full(len(time_s), reading.offset_s), np.full(len(time_s), sd), reading.offset_s, 0.0,
                     False, {}, f"{reason}; the constant is used", ("gyro",))

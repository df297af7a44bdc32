"""The same commands as a slower log would hold them: thinned, lost and interpolated as on the way to a recording.

Rows of ten milliseconds are whole numbers of rows of the fast log, so that every input predicts the same instants.
"""

from collections.abc import Callable, Mapping

import numpy as np

from nanobench_tools.practice.logging_chain import LoggingChain, received, resample
from nanobench_tools.practice.timeline import TICK_S
from nanobench_tools.settings import number

from .rotor_rows import Log

RADIO_HZ = number("motors.radio.radio_hz")

CHAIN = LoggingChain()


def coarse_rows(row_s: float) -> int:
    """How many rows of the fast log make one of about 10 ms."""
    return max(round(TICK_S / row_s), 1)


def thinned(log: Log, first: np.ndarray, rng: np.random.Generator, rate_hz: float = RADIO_HZ) -> np.ndarray:
    """(m, 4) PWM at rows ``first`` (m,) of ``log`` from packets at 100 Hz, of which some are lost in bursts.

    Between packets that arrive, the next one included, it is a straight line."""
    time_s = np.arange(len(log.u)) * log.row_s
    found = np.full((len(first), 4), np.nan)
    for a, b in log.stretches:
        inside = (first >= a) & (first < b)
        sent = np.arange(time_s[a] + rng.uniform(0.0, TICK_S), time_s[b - 1], TICK_S)
        share = 1.0 - rate_hz * TICK_S
        arrives = received(rng, len(sent), share, CHAIN.burst, CHAIN.longest_gap_s)
        arrives[[0, -1]] = True
        row = np.minimum((sent[arrives] / log.row_s).astype(int), b - 1)
        found[inside] = resample(sent[arrives], log.u[row], time_s[first[inside]])
    return np.asarray(np.clip(found, 0.0, 1.0))


def sampled(log: Log, first: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(m, 4) PWM as it is at the rows, nothing lost: sampled every 10 ms."""
    return np.asarray(log.u[first])


def averaged_rows(log: Log, first: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(m, 4) mean PWM over each row of 10 ms."""
    return np.asarray(log.u[first[:, None] + np.arange(coarse_rows(log.row_s))].mean(axis=1))


COARSE: Mapping[str, Callable[[Log, np.ndarray, np.random.Generator], np.ndarray]] = {
    "radio": thinned, "sampled": sampled, "averaged": averaged_rows}
"""How 10 ms rows of PWM can come about."""

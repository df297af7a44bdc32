"""Rotor speed from PWM and voltage, RPM(PWM, V), once the lag has passed.

The candidates are the thrust maps of ``identification.thrust`` over T = k_f w^2, with one gain of thrust per motor.
For a motor, speed is in proportion to its voltage E. The command is lagged as found before it is compared, and both
are averaged over a quarter of a second. Chosen by whole flights that are held out in turn.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from identification.thrust.choose import HeldOut, choose
from identification.thrust.maps import MAPS, Map
from identification.thrust.stand_fit import Fit, fit_stands
from identification.thrust.stand_series import Stand
from nanobench_tools.settings import count, number

from .force import averaged
from .lag import Lag
from .rotor_rows import Log

BLOCK_S = number("motors.steady_speed.block_s")
MOST_FOLDS = count("motors.steady_speed.most_folds")
PASSES = 4
"""Alternations between the curve and the motors' gains; the fourth changes gains by less than 1e-4."""
CANDIDATES: Mapping[str, Map] = {name: m for name, m in MAPS.items() if m.fixed is None}


@dataclass(frozen=True)
class Steady:
    """One candidate: ``fit`` of the mean motor's thrust, ``gain`` (4,) of each (mean 1), k_f; speed = sqrt(g T/k_f)."""

    fit: Fit
    gain: np.ndarray
    k_f: float

    def speed(self, u: np.ndarray, battery_V: np.ndarray) -> np.ndarray:
        """(n, 4) rad/s at PWM ratios (n, 4) and voltage (n,)."""
        thrust = self.fit.predict(u, np.asarray(battery_V)[:, None])
        found: np.ndarray = np.sqrt(np.maximum(thrust * self.gain / self.k_f, 0.0))
        return found


@dataclass(frozen=True)
class Chosen:
    """fits and held-out errors by name, the chosen one (None: none is a result), spread: SD of the speeds."""

    fits: Mapping[str, Steady]
    scores: Mapping[str, HeldOut]
    best: str | None
    spread: float


def lagged(log: Log, lag: Lag) -> np.ndarray:
    """(n, 4) PWM ratio after the lag's mean time constant and its delay, stretch by stretch."""
    tau = 0.5 * (lag.tau_up_s + lag.tau_down_s)
    keep = float(np.exp(-log.row_s / tau)) if tau > 0.0 else 0.0
    shift = round(lag.delay_s / log.row_s) + 1  # the speed after a row of command is logged at the next
    found = log.u.copy()
    for a, b in log.stretches:
        part = lfilter([1.0 - keep], [1.0, -keep], log.u[a:b], axis=0, zi=log.u[a:a + 1] * keep)[0]
        found[a + shift:b] = part[:b - a - shift]
        found[a:a + shift] = log.u[a]
    return found


@dataclass(frozen=True)
class Blocks:
    """Means over a quarter of a second: u (n, 4), battery_V (n,), speed (n, 4)."""

    u: np.ndarray
    battery_V: np.ndarray
    speed: np.ndarray


def blocks_of(log: Log, lag: Lag) -> Blocks:
    return Blocks(averaged(log, lagged(log, lag), BLOCK_S), averaged(log, log.battery_V, BLOCK_S),
                  averaged(log, log.speed, BLOCK_S))


def fit_steady(candidate: Map, flights: Sequence[Blocks], k_f: float, start: Sequence[float] | None = None) -> Steady:
    """Curve and gains of one candidate."""
    gain = np.ones(4)
    fit = Fit(candidate, {}, "not fitted")
    for _ in range(PASSES):
        fit = fit_stands(candidate, [_stand(b, k_f, gain) for b in flights], None, start)
        if not fit.values:
            return Steady(fit, gain, k_f)
        start = fit.shape or None
        mean = [np.broadcast_to(fit.predict(b.u, b.battery_V[:, None]), b.u.shape) for b in flights]
        top = sum(np.sum(k_f * b.speed**2 * m, axis=0) for b, m in zip(flights, mean, strict=True))
        gain = top / sum(np.sum(m * m, axis=0) for m in mean)
        gain = gain / gain.mean()
    return Steady(fit, gain, k_f)


def choose_steady(flights: Sequence[Blocks], k_f: float) -> Chosen:
    """All candidates, each fitted to all flights and scored on flights held out in turn."""
    fits = {name: fit_steady(c, flights, k_f) for name, c in CANDIDATES.items()}
    groups = min(len(flights), MOST_FOLDS)
    scores = {}
    for name, candidate in CANDIDATES.items():
        found, trouble = [], fits[name].fit.trouble
        for g in range(groups if fits[name].fit.values and len(flights) > 1 else 0):
            train = [b for i, b in enumerate(flights) if i % groups != g]
            without = fit_steady(candidate, train, k_f, fits[name].fit.shape or None)
            trouble = trouble or without.fit.trouble
            found += [without.speed(b.u, b.battery_V) - b.speed for b in flights[g::groups]]
        rms = float(np.sqrt(np.mean(np.concatenate([e.ravel() for e in found]) ** 2))) if found else float("nan")
        scores[name] = HeldOut(tuple(found), rms, trouble)
    spread = float(np.std(np.concatenate([b.speed for b in flights]), axis=0).mean())
    return Chosen(fits, scores, choose({n: f.fit for n, f in fits.items()}, scores, spread=spread), spread)


def _stand(blocks: Blocks, k_f: float, gain: np.ndarray) -> Stand:
    """Rows of a flight in the shape of a stand series, all motors after one another."""
    thrust = k_f * blocks.speed**2 / gain
    return Stand("", "", "", blocks.u.ravel(), np.repeat(blocks.battery_V, 4), thrust.ravel(), None, None, 0.0, 0, 0)

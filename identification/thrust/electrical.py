"""Battery and motor parameters from a thrust-stand series in which current or speed were measured."""

import numpy as np
import scipy.stats

from nanobench_tools.results.fitted_values import Estimate, Value

from .stand_fit import Fit
from .stand_series import Stand

BLOCKS = 20
DRAWS = 200


def battery_resistance(stand: Stand, seed: int = 0) -> Estimate | None:
    """R [ohm] in V = V_0 - R I - k q, q the charge taken so far (sum of I over the rows); None
    without voltage or current. The interval draws blocks of rows."""
    if stand.battery_V is None or stand.current_A is None or np.ptp(stand.current_A) < 0.1:
        return None
    voltage = stand.battery_V
    taken = np.cumsum(stand.current_A) / np.sum(np.abs(stand.current_A))
    columns = np.stack([np.ones(len(stand)), -stand.current_A, -taken], axis=1)

    def resistance(rows: np.ndarray) -> float:
        return float(np.linalg.lstsq(columns[rows], voltage[rows], rcond=None)[0][1])

    blocks = np.array_split(np.arange(len(stand)), min(BLOCKS, len(stand)))
    drawn = scipy.stats.bootstrap(
        (np.arange(len(blocks)),), lambda drawn: resistance(np.concatenate([blocks[i] for i in drawn])),
        vectorized=False, n_resamples=DRAWS, method="percentile", rng=np.random.default_rng(seed)).confidence_interval
    return Estimate(resistance(np.arange(len(stand))), (float(drawn.low), float(drawn.high)), "ohm")


def motor_constants(fit: Fit, stand: Stand) -> dict[str, Value]:
    """k_f [N s^2/rad^2] from thrust and speed. With a map of the motor family also K_e = E / w [V s/rad], from T =
    kappa E^2 = k_f w^2. Empty without speeds."""
    k_f = stand.thrust_per_speed2
    if not np.isfinite(k_f) or k_f <= 0.0:
        return {}
    found = {"k_f": Value(k_f, "N s^2/rad^2")}
    kappa = fit.values.get("kappa")
    if kappa is not None and kappa > 0.0:
        found["K_e"] = Value(float(np.sqrt(k_f / kappa)), "V s/rad")
    return found

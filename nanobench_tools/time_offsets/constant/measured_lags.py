"""By how much each stream that the motion capture predicts follows it, and how that delay moves.

What the delays say about the timestamps is decided in ``readings``.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...signals import paired_signals, pairs
from ...signals.axis_unit_matching import axis_unit_matches
from ...signals.context import Context
from ...signals.mocap_derivatives import STEP_S, derivatives_of
from ..mathematics.lag_windows import Movement, movement
from ..mathematics.lags import Lag, best_lag, lag_sums

MEASURED_BY: dict[str, tuple[pairs.MakePair, ...]] = {
    "imu": (pairs.gyro_pair, pairs.force_pair),
    "attitude": (pairs.attitude_pair,),
    "attitude_qw": (pairs.attitude_qw_pair,),
    "estimator": (pairs.position_pair, pairs.velocity_pair),
    "estimator_acc": (pairs.acceleration_pair,),
}


@dataclass(frozen=True)
class Measured:
    """Delay of a stream against the motion capture, its change, and the signals compared. Also how its axes were
    corrected for that (order, sign, factor)."""

    lag: Lag
    movement: Movement | None
    by: str
    order: tuple[int, ...] = (0, 1, 2)
    sign: tuple[float, ...] = (1.0, 1.0, 1.0)
    factor: float = 1.0

    def upright(self, values: np.ndarray) -> np.ndarray:
        """(n, 3) of the stream -> in the axes, signs and unit of the reference."""
        return np.asarray((values * np.array(self.sign) / self.factor)[:, np.argsort(self.order)])


def measured_lags(context: Context) -> dict[str, Measured]:
    """For every stream that the motion capture predicts, by the first of its pairs that can be formed."""
    found = {}
    for name, makes in MEASURED_BY.items():
        for make in makes:
            pair = context.once(make)
            if pair is None:
                continue
            found_one = _measure(context, make, pair)
            if found_one is not None:
                found[name] = found_one
                break
    return found


def _measure(context: Context, make: pairs.MakePair, pair: paired_signals.Pair) -> Measured | None:
    sums, truth = pairs.sums_of(context, make), context.once(derivatives_of)
    if sums is None or truth is None:
        return None
    verdict = context.once(axis_unit_matches).get(make)
    time_s = truth.time_s
    name = "/".join(pair.quantities)
    if pair.free or verdict is None or not verdict.wrong:
        lag = best_lag(sums, pair.free)
        return Measured(lag, movement(pair.measured, pair.reference, time_s, sums, lag), name)
    # world frames agree once axes, signs and unit are put right
    fixed = Measured(best_lag(sums, True), None, name, verdict.order,
                     tuple(-1.0 if s < 0 else 1.0 for s in verdict.sign), verdict.factor)
    values = fixed.upright(pair.measured)
    mended = lag_sums(values, pair.reference, pair.use, STEP_S, pair.reach_s)
    if mended is None:
        return None
    lag = best_lag(mended, False)
    return replace(fixed, lag=lag, movement=movement(values, pair.reference, time_s, mended, lag))

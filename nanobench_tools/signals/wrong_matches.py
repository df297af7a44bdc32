"""The streams that are in other axes, signs or units than the motion capture, each mistake once."""

from dataclasses import replace

import numpy as np

from .axis_unit_matching import AxisUnitMatch, axis_unit_matches
from .context import Context
from .pairs import (
    PAIRS,
    acceleration_pair,
    force_pair,
    gyro_pair,
    mocap_rate_pair,
    mocap_velocity_pair,
    position_pair,
    setpoint_pair,
    velocity_pair,
)
from .shared_frame import shared_frame


def wrong_matches(context: Context) -> list[AxisUnitMatch]:
    """The streams that are in other axes, signs or units, each mistake once.

    Two streams that disagree with the motion capture in the same way are right, and the motion capture is wrong. For
    positions these are the estimator and the setpoint (else the estimated velocity), for rotations the gyro and the
    estimated attitude. Accelerations and forces are then compared with derivatives of wrong positions and say nothing.
    Axes that the streams share with turned poses are no mistake of theirs.
    """
    shared = context.once(shared_frame)
    found = {make: _unturned(match) if shared is not None and match.stream in shared.streams else match
             for make, match in context.once(axis_unit_matches).items()}
    wrong = {make: verdict for make, verdict in found.items() if verdict.wrong}
    judges = [make for make in (setpoint_pair, velocity_pair, mocap_velocity_pair) if make in found]
    if position_pair in wrong and judges:
        same = [make for make in judges if found[make].wrong == found[position_pair].wrong]
        if judges[0] in same:
            verdict = wrong[position_pair]
            wrong = {
                make: v
                for make, v in wrong.items()
                if v.stream not in ("estimator", "setpoint")
                and make not in (mocap_velocity_pair, acceleration_pair, force_pair)
            }
            wrong[position_pair] = _inverse(verdict, "mocap", ("px", "py", "pz"))
    turned = [make
              for make in PAIRS
              if make in wrong
              and found[make].stream in ("imu", "attitude", "attitude_qw")
              and "acc_x" not in found[make].quantities]
    if gyro_pair in turned and len(turned) > 1 and wrong[turned[0]].wrong == wrong[turned[1]].wrong:
        verdict = wrong[gyro_pair]
        wrong = {make: v for make, v in wrong.items() if make not in turned and make is not mocap_rate_pair}
        wrong[gyro_pair] = _inverse(verdict, "mocap", ("qx", "qy", "qz"))
    return list(wrong.values())


def _inverse(verdict: AxisUnitMatch, stream: str, quantities: tuple[str, ...]) -> AxisUnitMatch:
    """The same disagreement, blamed on the reference."""
    order = tuple(int(i) for i in np.argsort(verdict.order))
    return AxisUnitMatch(stream, quantities, order, tuple(verdict.sign[i] for i in order),
                         tuple(verdict.correlation[i] for i in order), tuple(1.0 / verdict.ratio[i] for i in order),
                         verdict.swapped)


def _unturned(match: AxisUnitMatch) -> AxisUnitMatch:
    return replace(match, order=(0, 1, 2), sign=(0, 0, 0), swapped=False)

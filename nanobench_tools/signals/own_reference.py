"""The vehicle's own estimate as the reference in recordings without motion capture.

The rate of the estimated position is the estimated velocity, and the path accelerates towards the side to which the
estimated attitude tilts. Where they contradict each other, one column is negated, in another unit, or exchanged. On
real flights the estimated velocity correlates by +0.6 to +1.0 with the rate of the position (n = 60).
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import so3
from ..flight import make_stream
from .attitude_signs import contradicted_angles
from .axis_unit_matching import ALONE, AxisUnitMatch, match_of
from .context import Context
from .dropouts import alive_until
from .estimated_turning import estimated_attitude
from .flown_axes import tracker_scale
from .held_poses import POSITION, ROTATION
from .pairs import MakePair, acceleration_pair, request_pair, setpoint_pair, sums_of, velocity_pair
from .path_sizes import tilted_path
from .pose_frame import PoseFrame, pose_frame
from .shared_frame import PLACE, height_alone, shared_frame
from .tilt_heading import FOLLOWS, mirrored, straight, tilt_and_acceleration
from .usable_rows import usable_streams

JUDGES = (velocity_pair, acceleration_pair, setpoint_pair)
"""Where two of them contradict the position and none confirms it, the position is wrong."""


@dataclass(frozen=True)
class Contradiction:
    """``kind``: sign, axis_swap or unit, of ``quantities`` of a stream. ``factor``: of a unit, else -1."""

    kind: str
    stream: str
    quantities: tuple[str, ...]
    factor: float
    evidence: str


def own_reference(context: Context) -> Context | None:
    """The recording with the estimated poses as its motion capture. Without an
    attitude they are level and the tilt shows nothing. None with a motion capture, without a position, and where all
    axes are turned as a whole."""
    streams, attitude = context.once(usable_streams), estimated_attitude(context)
    place = streams.get("estimator")
    if "mocap" in context.flight or place is None or not all(q in place for q in PLACE) \
            or context.once(shared_frame) is not None:
        return None
    known: dict[Callable[..., Any], Any] = {tracker_scale: 1.0, pose_frame: PoseFrame()}  # these are what is judged
    judged = ["estimator", *(name for name in ("attitude_qw", "attitude") if attitude is not None and name in streams)]
    end = min(context.once(alive_until)[name] for name in judged)
    rows = place.rows(np.isfinite(place[PLACE]).all(axis=1) & (place.time_s <= end))
    if attitude is None or len(attitude) < 2:
        turn, known[tilt_and_acceleration] = np.tile([0.0, 0.0, 0.0, 1.0], (len(rows), 1)), None
    else:
        turn = so3.interpolate(attitude.time_s, attitude[ROTATION], rows.time_s)
    poses = make_stream("mocap", rows.time_s, np.column_stack([rows[PLACE], turn]), (*POSITION, *ROTATION))
    return Context(context.flight.with_streams(mocap=poses), known)


def contradictions(context: Context) -> list[Contradiction]:
    """Columns of the estimate and of the set-point that contradict the estimated position or tilt, each once."""
    own = context.once(own_reference)
    if own is None:
        return []
    places = list(_places(context, own))
    wrong = {q for found in places for q in found.quantities}
    follows = straight(own) > FOLLOWS
    matches = matches_by_estimate(own, (*JUDGES, request_pair))
    found = places + [c for match in matches for c in _of_match(match, follows)
                      if match.stream == "pid" or not wrong & {q[-1] for q in c.quantities}]
    if height_alone(context.once(usable_streams)["estimator"]) and not any({"z", "vz"} & set(c.quantities)
                                                                           for c in found):
        found.append(Contradiction("sign", "estimator", ("z",), -1.0,
                                   "z of estimator falls where vz climbs; or vz is negated"))
    return found


def matches_by_estimate(own: Context, pairs: Iterable[MakePair] = JUDGES) -> list[AxisUnitMatch]:
    """Those of ``pairs`` that can be formed in the context of ``own_reference``."""
    formed = [(own.once(make), sums_of(own, make)) for make in pairs]
    matches = [match_of(pair, sums) for pair, sums in formed if pair is not None and sums is not None]
    return [match for match in matches if match is not None]


def _places(context: Context, own: Context) -> Iterator[Contradiction]:
    """Axes of the estimated position that the tilt, or velocity and set-point together, contradict."""
    mirror, tilt = own.once(mirrored), tilted_path(own)
    names = dict(zip(POSITION, PLACE, strict=True))
    if tilt is not None:
        yield Contradiction("unit", "estimator", tuple(names[q] for q in tilt.quantities), tilt.factor,
                            tilt.evidence.replace("px", "x").replace("py", "y"))
    if mirror is not None and not context.once(contradicted_angles):
        along = tuple(names[q] for q in mirror.quantities)
        yield Contradiction("axis_swap" if mirror.swapped else "sign", "estimator", along, -1.0,
                            f"the estimate speeds up along {', '.join(along)} as the mirror image of its tilt "
                            f"({mirror.follows:+.2f})")
        return
    judges = [match for match in matches_by_estimate(own) if not match.swapped]
    for i, quantity in enumerate(PLACE):
        signs = [match.sign[i] for match in judges]
        if signs.count(-1) > 1 and max(signs) < 1:
            against = " and ".join(m.quantities[i] + f" of {m.stream}" for m in judges if m.sign[i])
            yield Contradiction("sign", "estimator", (quantity,), -1.0,
                                f"{quantity} of estimator moves against {against}")


def _of_match(match: AxisUnitMatch, follows: bool) -> Iterator[Contradiction]:
    """``follows``: whether the tilt confirms x and y of the position."""
    by = "attitude" if match.stream == "pid" else "position"
    sure = ("vx", "vy", "ax", "ay") if follows else ()
    moved = [i for i in range(3) if match.order[i] != i]
    if match.swapped:
        seen = ", ".join(f"{match.quantities[i]} looks like {'xyz'[match.order[i]]} of the estimated {by} "
                         f"({match.correlation[i]:+.2f})" for i in moved)
        yield Contradiction("axis_swap", match.stream, tuple(match.quantities[i] for i in moved), -1.0, seen)
    for quantity, sign, k in zip(match.quantities, match.sign, match.correlation, strict=True):
        if sign < 0:
            yield Contradiction("sign", match.stream, (quantity,), -1.0,
                                f"{quantity} of {match.stream} correlates {k:+.2f} with what the estimated {by} "
                                f"predicts" + f": it is negated; or the {by} is" * (quantity not in sure))
    for axes, named in match.scaled:
        if max(abs(match.correlation[i]) for i in axes) < ALONE:
            continue
        names = tuple(match.quantities[i] for i in axes)
        yield Contradiction("unit", match.stream, names, named.factor,
                            f"{', '.join(names)} of {match.stream} {'are' if len(names) > 1 else 'is'} {named.words} "
                            f"times what the estimated {by} predicts{named.reading}"
                            + f"; or the {by} is in another unit" * (not set(names) <= set(sure)))

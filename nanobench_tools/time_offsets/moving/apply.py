"""The clocks every protocol can be run with: as recorded, constant offset removed, moving error removed."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ... import so3
from ...errors import InputError, UsageError
from ...flight import Flight, Stream
from ...signals.context import Context
from ..constant.readings import read_clocks
from .confirm import believed
from .evidence import KINDS
from .time_offset import TimeOffset, retime
from .votes import AS_RECORDED, voters


def find_time_offset(flight: Flight, clock: str, judged: Iterable[str] = ()) -> TimeOffset | None:
    """Correction of the timestamps of ``flight`` for ``clock`` (``votes.CLOCKS``). Here ``judged`` (of
    ``votes.ESTIMATES``) are the estimates judged on it; None if it cannot be identified.

    Uses the motion capture of the whole flight: suitable for finding what limits a method, never for an online claim.
    Raises UsageError if the clock may not judge them.
    """
    judged = judged if isinstance(judged, str) else tuple(judged)
    _kinds(clock, judged)  # report an impossible choice before anything is computed
    return time_offset_of(Context(flight), clock, judged)


def time_offset_of(context: Context, clock: str, judged: Iterable[str] = ()) -> TimeOffset | None:
    """``find_time_offset`` of the flight of ``context``, with what was derived for it before."""
    kinds = _kinds(clock, judged)
    if clock == "offset":
        reading = context.once(read_clocks).get("imu")
        if reading is None or not reading.identifiable:
            return None
        none = np.zeros(0)
        return TimeOffset(none, none, none, reading.offset_s, 0.0, False, {}, "constant offset of the gyro", kinds)
    # what the audit asks for has the same votes as ``joint``
    return context.once(believed) if kinds == tuple(KINDS) else believed(context, kinds)


def _kinds(clock: str, judged: Iterable[str]) -> tuple[str, ...]:
    if clock == AS_RECORDED:
        raise UsageError(f"clock {AS_RECORDED} takes nothing out: use the flight as it is")
    return voters(clock, judged)


def retimed(flight: Flight, clock: str = "retimed", judged: Iterable[str] = ("position", "velocity")) -> Flight:
    """A copy with every stream moved to the motion capture's clock: the moving error where other streams confirm it,
    else the constant offset; ``Stream.time_sd_s`` says how well, ``provenance.notes`` what was done.

    ``clock``: ``retimed``, ``joint`` or ``offset``; ``judged``: which logged estimates you will judge on it, so that
    they get no vote (``votes``); ``joint`` needs ``judged=()``. Values, their order and ``samples`` stay. InputError
    where no time error can be identified, and where timestamps were moved before. There the remainder would be taken
    for a time error once more.
    """
    if flight.provenance.clock_evidence:
        raise InputError(flight.provenance.path, "its timestamps were moved before, by "
                         f"{', '.join(flight.provenance.clock_evidence)}", "use the recording as it was read")
    time_offset = find_time_offset(flight, clock, judged)
    if time_offset is None:
        reading = read_clocks(Context(flight)).get("imu")
        why = "it has no imu stream" if reading is None else reading.reason
        raise InputError(flight.provenance.path, f"its clock cannot be identified: {why}", "use it as recorded")
    return retime(flight, time_offset)


def apply_time_offset(flight: Flight, time_offset: TimeOffset | None) -> Flight:
    """``flight`` re-timed, its streams put back on the rows of the motion capture; unchanged without a warp."""
    return flight if time_offset is None else on_rows(retime(flight, time_offset))


def on_rows(flight: Flight) -> Flight:
    """Interpolate every firmware stream linearly at the timestamps of the motion capture (quaternions along the great
    circle). True sample counts are kept, so that these rows still do not count as measurements."""
    rows_s = flight["mocap"].time_s
    return replace(flight, streams={name: s if name == "mocap" or len(s) < 2 else _resampled(s, rows_s)
                                    for name, s in flight.streams.items()})


def _resampled(stream: Stream, rows_s: np.ndarray) -> Stream:
    # equal timestamps (samples delivered in one burst) keep the last of them
    last = np.concatenate((np.diff(stream.time_s) > 0.0, [True]))
    t, values = stream.time_s[last], stream.values[last]
    moved = np.column_stack([np.interp(rows_s, t, values[:, k]) for k in range(values.shape[1])])
    if {"qx", "qy", "qz", "qw"} <= set(stream.quantities):
        where = [stream.index(q) for q in ("qx", "qy", "qz", "qw")]
        moved[:, where] = so3.interpolate(t, values[:, where], rows_s)
    sd = None if stream.time_sd_s is None else np.interp(rows_s, t, stream.time_sd_s[last])
    return replace(stream, time_s=rows_s, values=moved, time_sd_s=sd)

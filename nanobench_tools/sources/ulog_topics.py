"""Streams of a ULog, by the table of PX4's names (``known/px4.toml``), in our units and axes.

A stream comes from one topic: the first of the table that was logged. The truth of a simulator is in two topics, which
are one stream where their timestamps agree. Column names are ``topic.field``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .. import so3
from ..errors import UsageError
from ..flight import STREAM_QUANTITIES, Stream, make_stream
from .axes import EULER, QUATERNION, frame_of, in_our_axes
from .known import Known, ecosystem

FARTHEST_STAMP_S = 1e5
"""A timestamp further than this from the middle one of its topic is damage: no log lasts a day."""


@dataclass(frozen=True)
class Topic:
    """One instance of a topic: ``fields`` (n,) each by flattened name, and ``time_us`` (n,) since boot. ``lost`` rows
    have a damaged timestamp."""

    name: str
    time_us: np.ndarray
    fields: dict[str, np.ndarray]
    lost: int = 0

    def array(self, *names: str) -> np.ndarray | None:
        """(n, k), or None when a field is not there, or none is named. Values that are no measurement become NaN."""
        if not names or any(n not in self.fields for n in names):
            return None
        with np.errstate(invalid="ignore"):
            values = np.stack([self.fields[n].astype(float) for n in names], axis=1)
            return np.where(np.abs(values) < 1e12, values, np.nan)


def topic_of(name: str, fields: dict[str, np.ndarray]) -> Topic | None:
    """The rows of one logged topic, on the time of measuring if that was logged in addition to that of sending."""
    if "timestamp" not in fields or not len(fields["timestamp"]):
        return None
    time_us = fields["timestamp"].astype(np.float64)
    sampled = fields.get("timestamp_sample")
    if sampled is not None and (sampled > 0).all() and (np.abs(time_us - sampled.astype(np.float64)) < 1e6).all():
        time_us = sampled.astype(np.float64)
    near = np.abs(time_us - np.median(time_us)) < 1e6 * FARTHEST_STAMP_S
    kept = fields if near.all() else {k: v[near] for k, v in fields.items()}
    return Topic(name, time_us[near], kept, int((~near).sum()))


PX4 = ecosystem("px4")
MOTORS = ("motor", "rpm")
"""Streams whose fields depend on the vehicle (``ulog_motors``)."""
POSITION_TOPIC = "vehicle_local_position"
VALID = {**dict.fromkeys(("x", "y"), "xy_valid"), "z": "z_valid", **dict.fromkeys(("vx", "vy"), "v_xy_valid"),
         "vz": "v_z_valid"}
"""Field of ``POSITION_TOPIC`` -> the flag with which PX4 says that it knows it."""
INTERVAL = "_dt"
"""Behind the name of an increment: the microseconds it was collected in."""
TRUTH = "_groundtruth"
"""Behind the name of a topic with the truth of a simulator."""
SAME_STAMPS = 0.9
"""Least share of the rows of one topic of truth at whose timestamps another must have one, too: a convention."""


def topics_of(*streams: str) -> tuple[str, ...]:
    """Topics that may give these streams, the best first; without any, all but those of motors."""
    return tuple(name for name, known in PX4.topics.items()
                 if any(k.stream in streams if streams else k.stream not in MOTORS for k in known))


def streams_of(topics: Mapping[str, Sequence[Topic]], unread: list[str]) -> dict[str, Stream]:
    """All streams but those of motors. ``topics`` holds all instances by name; ``unread`` gets topics in a layout that
    nobody foresaw. Times are still seconds since boot."""
    found: dict[str, Stream] = {}
    for name in topics_of():
        for topic in topics.get(name, ()):
            for stream in dict.fromkeys(known.stream for known in PX4.topics[name]):
                try:
                    made = _read(stream, topic)
                    if made is not None and stream not in found:
                        found[stream] = made
                    elif made is not None and _is_truth(made) and _is_truth(found[stream]):
                        found[stream] = _completed(found[stream], made)
                except (UsageError, ValueError, IndexError, KeyError, TypeError, ArithmeticError) as error:
                    unread.append(f"{name} cannot be read ({type(error).__name__}: "
                                  f"{' '.join(str(error).split())[:80]})")
    if "attitude_qw" in found:
        found["attitude"] = _euler(found["attitude_qw"])
    return found


def left_out(topics: Mapping[str, Sequence[Topic]], streams: Mapping[str, Stream]) -> list[str]:
    """A sentence for every topic that has what a stream lacks, and is another topic than that of the stream."""
    told = []
    for name in topics_of():
        lacking = [k for k in PX4.topics[name] if name in topics and k.stream in streams
                   and k.quantity not in streams[k.stream].quantities and topics[name][0].array(k.name) is not None]
        for stream in dict.fromkeys(known.stream for known in lacking):
            used = streams[stream].columns[0].partition(".")[0]
            quantities = ", ".join(dict.fromkeys(known.quantity for known in lacking if known.stream == stream))
            if used != name:
                told.append(f"{quantities} of {name} not read: {stream} is {used}, whose timestamps differ")
    return told


def _read(stream: str, topic: Topic) -> Stream | None:
    """What one topic gives of a stream; None without any number."""
    chosen: dict[str, tuple[Known, np.ndarray]] = {}
    for known in PX4.topics[topic.name]:
        if known.stream != stream or known.quantity in chosen:
            continue
        values = _values(known, topic)
        if values is not None and np.isfinite(values).any():
            chosen[known.quantity] = known, values
    if not chosen:
        return None
    chosen = {quantity: chosen[quantity] for quantity in STREAM_QUANTITIES[stream] if quantity in chosen}
    block = np.stack([values for _, values in chosen.values()], axis=1)
    if turn := [k for k, quantity in enumerate(chosen) if quantity in QUATERNION]:
        block[:, turn] = np.where(block[:, turn].any(axis=1, keepdims=True), block[:, turn], np.nan)  # zeros: none sent
    made = stream_of(stream, topic, tuple(chosen), [known.name for known, _ in chosen.values()], block)
    frame = next((known.frame for known, _ in chosen.values() if known.frame), "")
    return in_our_axes(made, frame_of(frame)) if made is not None and frame else made


def _values(known: Known, topic: Topic) -> np.ndarray | None:
    """(n,) in SI, still in PX4's axes; NaN where PX4 knows no value; None without the field."""
    found = topic.array(known.name)
    if found is None:
        return None
    values: np.ndarray = found[:, 0]
    if known.what:  # an increment
        interval = topic.array(f"{known.name.partition('[')[0]}{INTERVAL}")
        if interval is None:
            return None
        with np.errstate(divide="ignore", invalid="ignore"):
            values = np.where(interval[:, 0] > 0.0, values / (1e-6 * interval[:, 0]), np.nan)
    if known.invalid is not None:
        values = np.where(values == known.invalid, np.nan, values)
    flag = topic.array(VALID[known.name]) if topic.name == POSITION_TOPIC and known.name in VALID else None
    if flag is not None:
        values = np.where(flag[:, 0] > 0, values, np.nan)
    return values * known.scale + known.offset


def stream_of(name: str, topic: Topic, quantities: Sequence[str], fields: Sequence[str],
              values: np.ndarray) -> Stream | None:
    """A stream of ``values`` (n, k) from ``fields``; None without any number.

    Columns and rows without any value are no samples (PX4 writes NaN for what it does not know). Times are still
    microseconds since boot, as seconds.
    """
    known = np.isfinite(values)
    columns = np.flatnonzero(known.any(axis=0)).tolist()
    if not columns:
        return None
    filled = known.any(axis=1)
    time_s = 1e-6 * topic.time_us[filled]
    return make_stream(name, time_s, values[filled][:, columns], [quantities[k] for k in columns],
                       [f"{topic.name}.{fields[k]}" for k in columns], samples=len(time_s), rate_hz=_rate(time_s))


def _rate(time_s: np.ndarray) -> float:
    duration = float(time_s[-1] - time_s[0])
    return (len(time_s) - 1) / duration if duration > 0.0 else float("nan")


def _is_truth(stream: Stream) -> bool:
    return stream.columns[0].partition(".")[0].endswith(TRUTH)


def _completed(stream: Stream, other: Stream) -> Stream:
    """``stream`` with the quantities that only ``other`` has, where that has the same timestamps."""
    new = [k for k, quantity in enumerate(other.quantities) if quantity not in stream.quantities]
    at = np.clip(np.searchsorted(other.time_s, stream.time_s), 0, len(other) - 1)
    same = other.time_s[at] == stream.time_s
    if not new or same.mean() < SAME_STAMPS:
        return stream
    added = np.where(same[:, None], other.values[at][:, new], np.nan)
    return replace(stream, values=np.hstack([stream.values, added]),
                   columns=(*stream.columns, *(other.columns[k] for k in new)),
                   quantities=(*stream.quantities, *(other.quantities[k] for k in new)),
                   unit=(*stream.unit, *(other.unit[k] for k in new)))


def _euler(turn: Stream) -> Stream:
    angles = so3.euler_zyx(np.stack([turn[q] for q in QUATERNION], axis=1))
    name = turn.columns[0].partition("[")[0]
    return make_stream("attitude", turn.time_s, angles, EULER, [name] * 3, samples=turn.samples, rate_hz=turn.rate_hz)

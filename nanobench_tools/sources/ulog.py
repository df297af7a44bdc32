"""PX4 flight logs: ULog (``.ulg``, parsed by pyulog, extra ``ulog``) or tables. ``ulog_topics`` has topics and axes."""

from __future__ import annotations

import contextlib
import io
import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, how_to_install
from ..flight import Fault, Flight, Provenance, Stream
from . import ulog_motors
from .base import not_numbers, text_fault
from .members import Gathered
from .sheets import Sheet
from .ulog_messages import MAGIC, Whole, whole_messages
from .ulog_tables import gathered, is_a_topic, topics_in
from .ulog_topics import Topic, left_out, streams_of, topic_of, topics_of

CLOCK_TOPICS = ("vehicle_gps_position", "sensor_gps")
MEASURED = ("imu", "attitude", "attitude_qw", "battery", "rpm")
"""Streams in which NaN is no way of saying "not given"."""

SEEN = {"vehicle_visual_odometry": ": poses from outside, by motion capture or by a camera on board; the log does not "
        "show which"}
"""Topic of motion capture -> what else it may be."""

FIRST_UTC_US = 10**15
"""Earlier times (2001) are a receiver without a fix."""

_printing = threading.Lock()


class Px4Log:
    """Source ``ulog``: a log, or the tables of it that ``ulog2csv`` writes."""

    name = "ulog"
    version = 2

    def recognises(self, path: Path, head: bytes) -> bool:
        return head.startswith(MAGIC) or is_a_topic(path, head)

    def wanted(self, names: Sequence[str]) -> list[str]:
        return []

    def gather(self, paths: Sequence[Path]) -> list[Gathered]:
        """The tables of one log are one recording, and so is a log."""
        tables = gathered(paths)
        inside = {path for group in tables for path in group.files.values()}
        return [*(Gathered(path, path, {path.name: path}) for path in paths if path not in inside), *tables]

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        return self.read_members(path, {path.name: data})

    def read_members(self, place: Path, members: Mapping[str, bytes]) -> Flight:
        data = next(iter(members.values()))
        if not data.startswith(MAGIC):
            return _flight(place, topics_in(place, members), {}, {}, ())
        whole = whole_messages(data)
        log = _parse(whole.data, str(place))
        topics = _topics(log)
        parameters = {k: v for k, v in log.initial_parameters.items() if isinstance(v, int | float)}
        about = {"firmware": str(log.msg_info_dict.get("ver_sw_release_str", log.get_version_info_str() or "unknown")),
                 "hardware": str(log.msg_info_dict.get("ver_hw", "unknown"))}
        flight = _flight(place, topics, parameters, about, tuple(sorted({d.name for d in log.data_list})[:8]),
                         _dropouts(log))
        return replace(flight, provenance=replace(flight.provenance, findings=(
            *_damage(whole, log, topics, flight.span.end_s), *flight.provenance.findings)))


def _flight(place: Path, topics: dict[str, list[Topic]], parameters: Mapping[str, float], about: Mapping[str, str],
            logged: Sequence[str], notes: Sequence[str] = ()) -> Flight:
    unread: list[str] = []
    streams = streams_of(topics, unread)
    turning = ulog_motors.motors(topics, parameters, unread)
    streams |= turning.streams
    if not streams:
        raise InputError(
            str(place),
            "a ULog without attitude, position, inertial sensor, motors or battery",
            f"of what is known here it holds {', '.join(logged)}" if logged
            else "the log was stopped before it began, or cut",
        )
    start = min(float(s.time_s[0]) for s in streams.values())
    streams = {n: replace(s, time_s=s.time_s - start) for n, s in sorted(streams.items())}
    end = max(s.span.end_s for s in streams.values())
    findings = [replace(f, start_s=f.start_s - start, end_s=f.end_s - start) for f in turning.findings]
    findings += [text_fault("bad_cell", "", (what.partition(" ")[0],), f"topic {what}, left out", (0.0, end))
                 for what in dict.fromkeys(unread)]
    findings += not_numbers({n: s for n, s in streams.items() if n in MEASURED})
    boot = _boot_unix_s(topics)
    clock = "seconds since boot" if boot is None else "UTC by satellite"
    return Flight(place.name, streams, {"family": None, "speed": None, "reference_speed_m_s": None, "clock": clock,
                                        **about},
                  Provenance(str(place), "", Px4Log.name, False, tuple(findings),
                             (*_notes(streams), *notes, *left_out(topics, streams), *turning.notes)),
                  epoch_s=start + (boot or 0.0))


def _parse(data: bytes, place: str) -> Any:
    try:
        from pyulog import ULog
    except ImportError:
        raise InputError(place, "a PX4 log is read through pyulog", how_to_install("ulog")) from None
    try:
        with _printing, contextlib.redirect_stdout(io.StringIO()):  # it prints what the findings say
            return ULog(io.BytesIO(data), [*topics_of(), *ulog_motors.TOPICS, *CLOCK_TOPICS])
    except Exception as error:  # damage can make a parser raise anything
        raise InputError(place, f"cannot be read as ULog ({type(error).__name__}: {error})",
                         "take another copy of the file") from None


def _topics(log: Any) -> dict[str, list[Topic]]:
    """Instances of every topic, the first one first unless it ended early."""
    found: dict[str, list[Topic]] = {}
    for item in sorted(log.data_list, key=lambda d: (d.name, d.multi_id)):
        if (topic := topic_of(item.name, item.data)) is not None and len(topic.time_us):
            found.setdefault(item.name, []).append(topic)
    return {name: sorted(instances, key=lambda t: np.ptp(t.time_us) < 0.5 * max(np.ptp(i.time_us) for i in instances))
            for name, instances in found.items()}


def _boot_unix_s(topics: dict[str, list[Topic]]) -> float | None:
    """Unix time [s] of the zero of the log's clock, where a satellite receiver knew it."""
    for name in CLOCK_TOPICS:
        for topic in topics.get(name, ()):
            utc = topic.fields.get("time_utc_usec")
            if utc is not None and (known := utc > FIRST_UTC_US).any():
                return float(np.median(1e-6 * (utc[known].astype(float) - topic.time_us[known])))
    return None


def _notes(streams: Mapping[str, Stream]) -> list[str]:
    notes = ["axes: PX4's NED and FRD turned into x east, y north, z up and x forward, y left, z up"]
    if "mocap" in streams:
        topic = streams["mocap"].columns[0].partition(".")[0]
        notes.append(f"mocap is {topic}" + SEEN.get(topic, ""))
    else:
        notes.append("no pose from outside was logged: only the vehicle's own estimate")
    return notes


def _dropouts(log: Any) -> list[str]:
    longest = max((d.duration for d in log.dropouts), default=0)
    return [f"the logger dropped out {len(log.dropouts)} times, longest {longest} ms"] if log.dropouts else []


def _damage(whole: Whole, log: Any, topics: dict[str, list[Topic]], end: float) -> list[Fault]:
    """truncated and checksum: a log that ends inside a message, invalid bytes, timestamps beyond any flight."""
    faults = []
    if whole.cut:
        evidence = f"the log ends inside a message, {whole.cut} bytes after its last whole one"
        faults.append(text_fault("truncated", "", (), evidence, (end, end)))
    lost = sum(t.lost for found in topics.values() for t in found)
    if whole.strange is not None or lost or log.file_corruption:
        where = "messages do not fit their formats"
        if whole.strange is not None:
            where = f"byte {whole.strange} begins no ULog message, {whole.left_out} bytes left out"
        more = f"; {lost} messages with impossible times left out" if lost else ""
        evidence = f"{where}; read what could still be parsed{more}"
        faults.append(text_fault("checksum", "", (), evidence, (0.0, end)))
    return faults

"""Binary logs of the Crazyflie uSD deck, versions 1 and 2 (firmware ``src/deck/drivers/src/usddeck.c``).

Little endian, no alignment. The header is 0xBC, u16 version, u16 number of event types. Each type has u16 id, name\\0,
u16 number of variables, each ``name(T)\\0``. Then follow records of u16 id, time since boot (version 1: u32 ms, version
2: u64 us) and the values. The end is a CRC-32 over everything before it, missing when the power was cut.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..flight import Fault, Flight, Provenance, Stream, make_stream
from .base import not_numbers, text_fault
from .cells import GIGANTIC
from .halved_values import halved
from .interpolation import count_changes
from .known import Known, ecosystem
from .sheets import Sheet

MAGIC = 0xBC
FIXED_FREQUENCY = "fixedFrequency"
DTYPES = {"B": "<u1", "b": "<i1", "H": "<u2", "h": "<i2", "I": "<u4", "i": "<i4", "f": "<f4", "e": "<f2"}
TIMES = {1: ("<u4", 1e-3), 2: ("<u8", 1e-6)}
"""Version -> type of the timestamp and its unit in seconds."""

ATTITUDE = ("qx", "qy", "qz", "qw")

LARGEST_STEP_S, LARGEST_RETURN_S = 60.0, 1.0
"""In a log whose checksum fails a record further from the one before is taken for the break."""


@dataclass(frozen=True)
class EventType:
    """One kind of record: dtype is packed, its first fields are ``id`` and ``time``."""

    name: str
    variables: tuple[str, ...]
    dtype: np.dtype


@dataclass(frozen=True)
class Log:
    """Records per event type as structured arrays (time in timestamps), and what is wrong: kind of fault and a
    sentence."""

    version: int
    types: dict[int, EventType]
    records: dict[int, np.ndarray]
    fault: tuple[str, str] | None


class UsdLog:
    """Source ``usd``."""

    name = "usd"
    version = 3

    def recognises(self, path: Path, head: bytes) -> bool:
        return (
            len(head) >= 5
            and head[0] == MAGIC
            and (struct.unpack_from("<H", head, 1)[0] in TIMES or f"{FIXED_FREQUENCY}\x00".encode() in head)
        )

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        log = parse_log(data, str(path))
        unit = TIMES[log.version][1]
        filled = {i: r for i, r in log.records.items() if len(r)}
        if not filled:
            raise InputError(str(path), "a uSD log without any record",
                             "logging was never started, or the card lost it")
        start = min(int(r["time"][0]) for r in filled.values())
        streams, faults = streams_of(log, filled, start, unit)
        if not streams:
            raise InputError(str(path), "a uSD log without any variable", "its configuration named none")
        end = max(s.span.end_s for s in streams.values())
        notes = [f"extra: {c} kept as found" for n, s in streams.items() if n.startswith("extra") for c in s.columns]
        return Flight(path.name,
                      streams,
                      {
                          "family": None,
                          "speed": None,
                          "reference_speed_m_s": None,
                          "clock": "seconds since boot",
                          "usd_version": log.version,
                          "records": {log.types[i].name: len(r) for i, r in log.records.items()},
                      },
                      Provenance(str(path), "", self.name, findings=(*_faults(log.fault, end), *faults),
                                 notes=tuple(notes)),
                      epoch_s=start * unit)


def parse_log(data: bytes, place: str) -> Log:
    """Everything in a log. Raises InputError at ``place`` when the header cannot be read."""
    version, types, body = _header(data, place)
    whole = len(data) - body >= 4 and zlib.crc32(data[:-4]) == struct.unpack_from("<I", data, len(data) - 4)[0]
    offsets, stop = _walk(data, body, len(data) - 4 if whole else len(data), types, TIMES[version], trusted=whole)
    raw = np.frombuffer(data, dtype=np.uint8)
    records = {}
    for i, kind in types.items():
        at = np.array(offsets[i], dtype=np.int64)
        block = (
            raw[at[:, None] + np.arange(kind.dtype.itemsize)]
            if len(at)
            else np.empty((0, kind.dtype.itemsize), np.uint8)
        )
        records[i] = np.ascontiguousarray(block).view(kind.dtype).reshape(-1)
    return Log(version, types, records, _verdict(data, stop, whole, types))


def _header(data: bytes, place: str) -> tuple[int, dict[int, EventType], int]:
    at = 1

    def number() -> int:
        nonlocal at
        if at + 2 > len(data):
            raise InputError(f"{place}: byte {at}", "the header of the uSD log ends early",
                             "take another copy of the file")
        at += 2
        return int(struct.unpack_from("<H", data, at - 2)[0])

    def text() -> str:
        nonlocal at
        end = data.find(b"\x00", at, at + 256)
        if end < 0:
            raise InputError(f"{place}: byte {at}", "a name in the header of the uSD log has no end",
                             "take another copy of the file")
        start, at = at, end + 1
        return data[start:end].decode("latin-1")

    version = number()
    if version not in TIMES:
        raise InputError(f"{place}: byte 1", f"uSD log version {version}", "versions 1 and 2 are known")
    types: dict[int, EventType] = {}
    for _ in range(number()):
        key, name = number(), text()
        fields: list[tuple[str, str]] = [("id", "<u2"), ("time", TIMES[version][0])]
        names: list[str] = []
        for _ in range(number()):
            where = at
            variable = text()
            if len(variable) < 4 or variable[-3] != "(" or variable[-1] != ")" or variable[-2] not in DTYPES:
                shown = "".join(c if c.isprintable() else "?" for c in variable[:40])
                raise InputError(f"{place}: byte {where}", f"variable '{shown}' of unknown type",
                                 "the header is damaged")
            names.append(variable[:-3])
            fields.append((f"v{len(names)}", DTYPES[variable[-2]]))
        if key in types:
            raise InputError(f"{place}: byte {at}", f"two event types with number {key}", "the header is damaged")
        types[key] = EventType(name, tuple(names), np.dtype(fields))
    return version, types, at


def _walk(data: bytes, at: int, end: int, types: dict[int, EventType], time: tuple[str, float],
          trusted: bool) -> tuple[dict[int, list[int]], int]:
    """Byte offsets of whole records per event type, and where the walk stopped."""
    sizes = {i: t.dtype.itemsize for i, t in types.items()}
    offsets: dict[int, list[int]] = {i: [] for i in types}
    stamp = struct.Struct("<HI" if time[0] == "<u4" else "<HQ")
    ahead, back = LARGEST_STEP_S / time[1], LARGEST_RETURN_S / time[1]
    last: int | None = None
    while at + stamp.size <= end:
        kind, now = stamp.unpack_from(data, at)
        size = sizes.get(kind)
        if size is None or at + size > end or not (trusted or last is None or -back <= now - last <= ahead):
            break
        offsets[kind].append(at)
        last, at = now, at + size
    return offsets, at


def _verdict(data: bytes, stop: int, whole: bool, types: dict[int, EventType]) -> tuple[str, str] | None:
    left = len(data) - stop
    if whole:
        return None if left == 4 else ("checksum", f"the checksum is right, yet byte {stop} begins no known record")
    head = struct.unpack_from("<H", data, stop)[0] if left >= 2 else None
    if left == 4 and head not in types:
        return "checksum", "the CRC-32 at the end does not fit the content; which bytes are wrong is not known"
    partial = head is None or (head in types and left < types[head].dtype.itemsize)
    if partial:
        return "truncated", f"the log ends inside a record, {left} bytes after its last whole one, and has no checksum"
    return "checksum", f"byte {stop} begins no record and no checksum fits; read up to there, {left} bytes left out"


def _faults(fault: tuple[str, str] | None, end: float) -> tuple[Fault, ...]:
    if fault is None:
        return ()
    kind, evidence = fault
    return (text_fault(kind, "", (), evidence, (0.0 if kind == "checksum" else end, end)),)


def streams_of(log: Log, filled: dict[int, np.ndarray], start: int,
               unit: float) -> tuple[dict[str, Stream], list[Fault]]:
    """Every quantity once, and faults of its values. A stream comes from the event type that has most of it; the rest
    goes to extra."""
    plans = {i: ecosystem("crazyflie").assign(log.types[i].variables) for i in filled}
    owner: dict[str, int] = {}
    for i, plan in plans.items():
        for stream, quantities in plan.items():
            best = owner.get(stream)
            events_first = log.types[i].name != FIXED_FREQUENCY
            if best is None or (len(quantities), events_first) > (
                len(plans[best][stream]),
                log.types[best].name != FIXED_FREQUENCY,
            ):
                owner[stream] = i
    streams: dict[str, Stream] = {}
    coded: dict[str, np.ndarray] = {}
    faults: list[Fault] = []
    for i, records in filled.items():
        kind = log.types[i]
        fields = {name: f"v{k}" for k, name in reversed(list(enumerate(kind.variables, start=1)))}
        time_s = (records["time"].astype(np.uint64) - np.uint64(start)).astype(np.int64) * unit
        used: set[str] = set()
        for stream, quantities in plans[i].items():
            if owner[stream] != i:
                continue
            values = _numbers(records, [fields[v.name] for v in quantities.values()])
            faults += _double(records, [fields[v.name] for v in quantities.values()], quantities, values, stream,
                              time_s)
            if stream == "mocap" and not any(values[:, k].any() for k, q in enumerate(quantities) if q in ATTITUDE):
                quantities = {q: v for q, v in quantities.items() if q not in ATTITUDE}  # positions only were sent
                values = values[:, : len(quantities)]
            as_logged = values
            values = values * [v.scale for v in quantities.values()] + [v.offset for v in quantities.values()]
            used.update(v.name for v in quantities.values())
            count = count_changes(values) if kind.name == FIXED_FREQUENCY else len(values)
            made = make_stream(stream, time_s, values, tuple(quantities), [v.name for v in quantities.values()],
                               samples=count, rate_hz=_rate(count, time_s))
            coded[stream] = _invalid(as_logged, quantities)
            forces = ["N" if v.unit == "N" else known for v, known in zip(quantities.values(), made.unit, strict=True)]
            streams[stream] = replace(made, unit=tuple(forces))
        rest = [v for v in dict.fromkeys(kind.variables) if v not in used]
        if rest:
            values = _numbers(records, [fields[v] for v in rest])
            name = "extra" if kind.name == FIXED_FREQUENCY else f"extra_{kind.name}"
            streams[name] = Stream(time_s, values, tuple(rest), tuple(rest), ("1",) * len(rest),
                                   rate_hz=_rate(len(values), time_s), samples=len(values))
    streams = dict(sorted(streams.items()))
    faults += not_numbers(streams)
    return {n: replace(s, values=np.where(coded[n], np.nan, s.values)) if n in coded and coded[n].any() else s
            for n, s in streams.items()}, faults


def _double(records: np.ndarray, fields: list[str], quantities: dict[str, Known], values: np.ndarray, stream: str,
            time_s: np.ndarray) -> list[Fault]:
    """Doubles, in ``values`` (n, k), what the firmware halved in variables of half precision; one finding each."""
    faults = []
    for k, (field, known) in enumerate(zip(fields, quantities.values(), strict=True)):
        if records.dtype[field] == np.float16 and (rows := halved(values[:, k])).any():
            values[rows, k] *= 2.0
            at = time_s[rows]
            faults.append(text_fault("half_precision", stream, (known.name,),
                                     f"{known.name}: {int(rows.sum())} values of half precision were halved just below "
                                     "a power of two (firmware before 2026.08), and doubled again",
                                     (float(at[0]), float(at[-1])), float(rows.sum()), "cells"))
    return faults


def _invalid(values: np.ndarray, quantities: dict[str, Known]) -> np.ndarray:
    """(n, k) bool: readings with which the firmware says that it has none."""
    return np.asarray(values == [np.nan if v.invalid is None else v.invalid for v in quantities.values()])


def _numbers(records: np.ndarray, fields: list[str]) -> np.ndarray:
    """(n, k) as logged; values that are no measurement (not finite, gigantic) are NaN."""
    with np.errstate(invalid="ignore"):  # damaged floats may be signalling NaN
        values = np.stack([records[f].astype(float) for f in fields], axis=1)
    return np.where(np.abs(values) < GIGANTIC, values, np.nan)


def _rate(samples: int | None, time_s: np.ndarray) -> float:
    duration = float(time_s[-1] - time_s[0]) if len(time_s) > 1 else 0.0
    return samples / duration if samples and duration > 0.0 else float("nan")

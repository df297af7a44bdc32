"""The raw recording: every packet as it came, appended to one file with its time on the host.

A file is a line of magic, the length of a JSON header and the header, then records. A record is ``<BBHdI``: kind,
number, bytes of payload, host time [Unix s], CRC-32 of all that and the payload. Then follows the payload. A separate
thread writes records every FLUSH_S. The header is repeated as a record at the beginning and at the end, so that no
single damage loses it. The sender thus never waits for a disk, and a killed program loses at most the
records since then. A file that ends inside a record is read up to there. Behind damage, reading goes on at the next
record with the right checksum, a known kind and a plausible time.
"""

from __future__ import annotations

import json
import os
import struct
import threading
import zlib
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import InputError

MAGIC = b"nanobench packets 1\n"
SUFFIX = ".packets"
FLUSH_S = 0.05
SYNC_S = 1.0
"""Interval at which the file is flushed to the disk, s: what a power cut may lose."""
CLOSE_S = 20.0
"""A disk, or a server with files, that takes longer for what waits at the end is given up."""
LOG, POSE, ECHO, SENT, REFERENCE, NOTE, LOOP = range(7)
"""Kinds. LOG: number of the block; tick [ms] in 24 bits, values. POSE: ``<d7f`` as pose datagrams. ECHO: ``<d`` host
time at which the echo was sent. SENT: header byte and data of a CRTP packet. REFERENCE: ``<4d`` x, y, z [m], yaw [rad]
that a controller on the host had to follow. NOTE: UTF-8 text, JSON of the sheet for number 1.
LOOP: ``<d`` delay [s] of a tick of the host's loop."""
KINDS = range(7)
TEXT, SHEET, HEADER = 0, 1, 2
NEAR_S = 86400.0
"""A record behind damage is of the same day as the one before."""
_HEAD = struct.Struct("<BBHd")
_SUM = struct.Struct("<I")
_LENGTH = struct.Struct("<I")


class Record(NamedTuple):
    kind: int
    number: int
    time_s: float
    payload: bytes


class PacketWriter:
    """Appends records to a new file; ``write`` may be called from any thread. Use as a context."""

    def __init__(self, path: Path, header: Mapping[str, Any]) -> None:
        text = json.dumps(header).encode()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except OSError as error:
            raise InputError(str(path), f"cannot be written ({error.strerror})", "check folder and permissions") \
                from None
        self.path = path
        self._waiting: deque[bytes] = deque()
        self._stop = threading.Event()
        self._failed: str | None = None
        self._header = _packed(NOTE, HEADER, float(header.get("started_unix_s", 0.0)), text)
        self._put(MAGIC + _LENGTH.pack(len(text)) + text + self._header)
        self._thread = threading.Thread(target=self._run, name="packet writer", daemon=True)
        self._thread.start()

    def write(self, kind: int, number: int, time_s: float, payload: bytes) -> None:
        """One record; on the file at most FLUSH_S later."""
        self._waiting.append(_packed(kind, number, time_s, payload))

    def note(self, time_s: float, text: str) -> None:
        self.write(NOTE, TEXT, time_s, text.encode()[:60_000])

    def sheet(self, time_s: float, content: Mapping[str, Any]) -> None:
        """The flight's sheet; the last one counts."""
        self.write(NOTE, SHEET, time_s, json.dumps(content).encode())

    def close(self) -> None:
        """Writes what waits. Raises InputError if anything could not be written (a full disk)."""
        self._waiting.append(self._header)
        self._stop.set()
        self._thread.join(CLOSE_S)
        if self._thread.is_alive():
            self._failed = f"the disk has not answered for {CLOSE_S:.0f} s"
        else:
            os.close(self._file)
        if self._failed:
            raise InputError(str(self.path), f"was not written to its end ({self._failed})", "is the disk full?")

    def __enter__(self) -> PacketWriter:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _run(self) -> None:
        flushes = 0
        while not self._stop.wait(FLUSH_S):
            self._flush()
            flushes += 1
            if flushes % round(SYNC_S / FLUSH_S) == 0:
                os.fsync(self._file)
        self._flush()

    def _flush(self) -> None:
        parts = []
        while self._waiting:
            parts.append(self._waiting.popleft())
        if parts and not self._failed:
            try:
                self._put(b"".join(parts))
            except OSError as error:
                self._failed = error.strerror or str(error)

    def _put(self, data: bytes) -> None:
        while data:
            data = data[os.write(self._file, data):]


def _packed(kind: int, number: int, time_s: float, payload: bytes) -> bytes:
    head = _HEAD.pack(kind, number, len(payload), time_s)
    return head + _SUM.pack(zlib.crc32(payload, zlib.crc32(head))) + payload


@dataclass(frozen=True)
class Packets:
    """A raw recording. ``cut`` shows in words what is missing inside and at its end; empty if nothing is."""

    header: dict[str, Any]
    records: list[Record]
    cut: str

    def of(self, kind: int, number: int | None = None) -> list[Record]:
        """Records of a kind (and number) in the order of writing."""
        return [r for r in self.records if r.kind == kind and (number is None or r.number == number)]

    @property
    def sheet(self) -> dict[str, Any]:
        """The last sheet, {} if none."""
        found = self.of(NOTE, SHEET)
        return json.loads(found[-1].payload) if found else {}


def read_packets(path: Path) -> Packets:
    """Reads the whole records of a raw recording. Raises InputError for another file."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})", "check the path") from None
    header, at = _header(data)
    if header is None and not _is_raw(path, data):
        raise InputError(str(path), "not a raw recording", "give a file that nanobench record or fly wrote")
    records: list[Record] = []
    lost: list[tuple[int, int]] = []
    near_s = None
    while at < len(data):
        record = _record(data, at)
        if record is None:
            following = _next_record(data, at + 1, near_s)
            lost.append((at, following))
            at = following
            continue
        at += _HEAD.size + _SUM.size + len(record.payload)
        if (record.kind, record.number) == (NOTE, HEADER):
            header = json.loads(record.payload)
            continue
        records.append(record)
        near_s = record.time_s
    if header is None:
        raise InputError(str(path), "its header is cut or damaged", "nothing had been recorded yet, or the header's "
                         "copies are lost, too")
    return Packets(header, records, _damage(lost, len(data)))


def _header(data: bytes) -> tuple[dict[str, Any] | None, int]:
    """The header at the beginning, and where records begin; None and 0 if it is damaged."""
    start = len(MAGIC) + _LENGTH.size
    if not data.startswith(MAGIC) or len(data) < start:
        return None, 0
    end = start + _LENGTH.unpack_from(data, len(MAGIC))[0]
    try:
        found = json.loads(data[start:end])
    except ValueError:
        return None, 0
    return (found, end) if isinstance(found, dict) else (None, 0)


def _is_raw(path: Path, data: bytes) -> bool:
    """Whether a file with a damaged beginning may be a raw recording, so that a search for its records is worth it."""
    return data.startswith(MAGIC) or path.suffix == SUFFIX


def _record(data: bytes, at: int) -> Record | None:
    """The record at a place, None if it is not whole."""
    step = _HEAD.size + _SUM.size
    if at + step > len(data):
        return None
    kind, number, size, time_s = _HEAD.unpack_from(data, at)
    payload = data[at + step:at + step + size]
    known = zlib.crc32(payload, zlib.crc32(data[at:at + _HEAD.size]))
    if len(payload) < size or known != _SUM.unpack_from(data, at + _HEAD.size)[0]:
        return None
    return Record(kind, number, time_s, payload)


def _next_record(data: bytes, at: int, near_s: float | None) -> int:
    """Place of the next whole record from ``at`` on; the end without."""
    while at + _HEAD.size + _SUM.size <= len(data):
        kind, _, size, time_s = _HEAD.unpack_from(data, at)
        if kind in KINDS and at + size < len(data) and (near_s is None or abs(time_s - near_s) < NEAR_S) \
                and _record(data, at) is not None:
            return at
        at += 1
    return len(data)


def _damage(lost: list[tuple[int, int]], size: int) -> str:
    """In words."""
    inside = [end - start for start, end in lost if end < size]
    left = sum(end - start for start, end in lost if end == size)
    parts = [f"{len(inside)} damaged place(s) of {sum(inside)} bytes were left out"] if inside else []
    parts += [f"the last {left} bytes are no whole record"] if left else []
    return "; ".join(parts)


def repair(path: Path, to: Path) -> Packets:
    """Writes the whole records of a damaged recording to a new file, and returns them. Raises InputError."""
    found = read_packets(path)
    with PacketWriter(to, found.header) as writer:
        for record in found.records:
            writer.write(*record)
    return found

"""Bags that were cut (power lost, disk full) written anew from what is whole in them, so that rosbags can read them."""

from __future__ import annotations

import bz2
import contextlib
import sqlite3
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

MCAP_MAGIC = b"\x89MCAP0\r\n"
MCAP_FOOTER, MCAP_CHUNK, MCAP_DATA_END = 2, 6, 15
ROS1_CONNECTION, ROS1_MESSAGE, ROS1_CHUNK = 7, 2, 5

_U32, _U64 = struct.Struct("<I").unpack_from, struct.Struct("<Q").unpack_from


SQLITE_MAGIC = b"SQLite format 3\x00"


def is_shorter_than_its_header(data: bytes) -> bool:
    """Whether pages at the end of an SQLite file are missing, which SQLite itself notices only where it needs them."""
    if not data.startswith(SQLITE_MAGIC) or len(data) < 100 or data[24:28] != data[92:96]:
        return False  # the number of pages is valid where both counters agree
    page = struct.unpack_from(">H", data, 16)[0]
    pages: int = struct.unpack_from(">I", data, 28)[0]
    return len(data) < pages * (65536 if page == 1 else page)


def _mcap(data: bytes, path: Path, mended: Path) -> None:
    """Whole records, then those inside an uncompressed chunk that was cut, then an end without summary."""
    kept = [MCAP_MAGIC]
    at = len(MCAP_MAGIC)
    while at + 9 <= len(data):
        kind, size = data[at], _U64(data, at + 1)[0]
        end = at + 9 + size
        if kind in (MCAP_FOOTER, MCAP_DATA_END) or kind == 0:
            break
        if end > len(data):
            if kind == MCAP_CHUNK:
                kept += _inside_chunk(data[at + 9 :])
            break
        kept.append(data[at:end])
        at = end
    kept.append(bytes([MCAP_DATA_END]) + struct.pack("<QI", 4, 0))
    kept.append(bytes([MCAP_FOOTER]) + struct.pack("<QQQI", 20, 0, 0, 0))
    mended.write_bytes(b"".join([*kept, MCAP_MAGIC]))


def _inside_chunk(chunk: bytes) -> list[bytes]:
    """Whole records of a chunk's beginning; none when it is compressed."""
    if len(chunk) < 40 or _U32(chunk, 28)[0] != 0:
        return []
    records, at = [], 40
    while at + 9 <= len(chunk) and (end := at + 9 + _U64(chunk, at + 1)[0]) <= len(chunk):
        records.append(chunk[at:end])
        at = end
    return records


def _sqlite(data: bytes, path: Path, mended: Path) -> None:
    """Rows up to the first page that is gone."""
    with contextlib.closing(sqlite3.connect(path)) as old, contextlib.closing(sqlite3.connect(mended)) as new:
        old.execute("PRAGMA writable_schema=ON")  # else a file shorter than its header says is refused
        new.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)")
        new.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
        for table, columns in (("topics", "id, name, type, serialization_format"),
                               ("messages", "id, topic_id, timestamp, data")):
            with contextlib.suppress(sqlite3.DatabaseError):
                for row in old.execute(f"SELECT {columns} FROM {table} NOT INDEXED ORDER BY id"):
                    new.execute(f"INSERT INTO {table}({columns}) VALUES(?, ?, ?, ?)", row)
        new.commit()


def _ros1(data: bytes, path: Path, mended: Path) -> None:
    """Messages of whole chunks, and those of an uncompressed chunk that was cut."""
    from rosbags.rosbag1 import Writer

    with Writer(mended) as writer:
        connections: dict[int, Any] = {}
        for header, body in _ros1_messages(data, data.index(b"\n") + 1):
            number = _U32(header["conn"], 0)[0]
            if header["op"][0] == ROS1_CONNECTION and number not in connections:
                about = dict(_ros1_fields(body))
                connections[number] = writer.add_connection(header["topic"].decode(),
                                                            about["type"].decode().replace("/", "/msg/"),
                                                            msgdef=about["message_definition"].decode(),
                                                            md5sum=about["md5sum"].decode())
            elif header["op"][0] == ROS1_MESSAGE and number in connections:
                seconds, nanoseconds = struct.unpack("<II", header["time"])
                writer.write(connections[number], seconds * 10**9 + nanoseconds, body)


def _ros1_messages(data: bytes, at: int) -> Iterator[tuple[dict[str, bytes], bytes]]:
    """Connection and message records, those inside chunks included; stops where a record is not whole."""
    while at + 8 <= len(data):
        middle = at + 4 + _U32(data, at)[0]
        if middle + 4 > len(data):
            return
        header, end = dict(_ros1_fields(data[at + 4 : middle])), middle + 4 + _U32(data, middle)[0]
        kind = header.get("op", b"\x00")[0]
        if kind == ROS1_CHUNK:
            yield from _ros1_messages(_unpacked(data[middle + 4 : end], header["compression"], end <= len(data)), 0)
        elif kind in (ROS1_CONNECTION, ROS1_MESSAGE) and end <= len(data):
            yield header, data[middle + 4 : end]
        at = end


def _unpacked(body: bytes, compression: bytes, whole: bool) -> bytes:
    if compression == b"none":
        return body
    if compression == b"bz2":
        return bz2.BZ2Decompressor().decompress(body)
    if compression == b"lz4" and whole:
        from lz4.frame import decompress

        found: bytes = decompress(body)
        return found
    return b""


def _ros1_fields(raw: bytes) -> Iterator[tuple[str, bytes]]:
    at = 0
    while at + 4 <= len(raw):
        size = _U32(raw, at)[0]
        name, _, value = raw[at + 4 : at + 4 + size].partition(b"=")
        yield name.decode("latin-1"), value
        at += 4 + size


REPAIRS: dict[str, Callable[[bytes, Path, Path], None]] = {".mcap": _mcap, ".db3": _sqlite, ".bag": _ros1}
"""Suffix -> (data, the file as it is, where to write)."""

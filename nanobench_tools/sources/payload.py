"""Bytes of a file: plain, gzip, bzip2, xz or a zip archive of one file, recognised by their first bytes.

An archive that ends early is read up to its end. Text in UTF-16 becomes UTF-8.
"""

from __future__ import annotations

import bz2
import hashlib
import io
import lzma
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

from ..errors import InputError
from .workbook import is_workbook, table_of

HEAD_BYTES = 8192
"""Enough for the header of every format; only this much is unpacked to recognise a file."""

ZIP_MAGIC = b"PK\x03\x04"
PACKED_SUFFIXES = (".xz", ".gz", ".bz2")
_DECODERS: dict[bytes, Callable[[], Any]] = {
    b"\xfd7zXZ\x00": lzma.LZMADecompressor, b"\x1f\x8b": lambda: zlib.decompressobj(16 + zlib.MAX_WBITS),
    b"BZh": bz2.BZ2Decompressor}
"""First bytes of a packed file -> how to unpack it."""
UNREADABLE = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, struct.error, OSError, ValueError, RuntimeError,
              NotImplementedError)
_UTF_16 = {"utf-16": re.compile(rb"\xff\xfe[\t-~]\x00|\xfe\xff\x00[\t-~]"),
           "utf-16-le": re.compile(rb"(?:[\t-~]\x00){8}"),
           "utf-16-be": re.compile(rb"(?:\x00[\t-~]){8}")}
"""Encoding -> first bytes of a text in it: its mark and a character of ASCII, or eight of
these."""

SMALL_BYTES = 256 * 1024**2
"""An archive of any size may unpack to this much."""
MOST_RATIO = 200
"""Tables of numbers pack to a third or a twentieth; an archive that unpacks to more times its size is made to fill the
memory."""
MOST_BYTES = 4 * 1024**3
"""Of one recording, unpacked: ten hours of an inertial sensor at 1 kHz as text."""
_CHUNK_BYTES = 16 * 1024**2


@dataclass(frozen=True)
class Payload:
    """Unpacked bytes of a file. ``broken`` is one sentence about an archive that ended early, else empty."""

    data: bytes
    broken: str = ""


def read_file(path: Path, limit: int | None = None) -> bytes:
    """The bytes as stored. Raises InputError that names the path."""
    try:
        with open(path, "rb") as file:
            return file.read() if limit is None else file.read(limit)
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror or error})",
                         "check the path and its permissions") from None


def digest(stored: bytes) -> str:
    """SHA-256 of the bytes as stored, hexadecimal."""
    return hashlib.sha256(stored).hexdigest()


def too_large(place: str, size: float, most: float) -> InputError:
    """The error for an archive that unpacks to far more than a recording."""
    return InputError(place, f"the archive unpacks to {size / 1024**2:.0f} MB or more, where a recording packed to its "
                      f"size has at most {most / 1024**2:.0f} MB", "it is damaged or no recording; unpack it by hand")


def _most(stored_bytes: int) -> int:
    """Bytes that an archive of this size may unpack to."""
    return min(max(SMALL_BYTES, MOST_RATIO * stored_bytes), MOST_BYTES)


def check_size(place: str, cells: int, stored: bytes) -> None:
    """InputError for a packed table of far more numbers than one of its size has."""
    size, most = 8 * cells, _most(len(stored))
    if size > most:
        raise too_large(place, size, most)


def _unpack_members(stored: bytes, new_decoder: Callable[[], Any], place: str) -> Payload:
    """All members of an archive, one after the other. One that only ends early is kept up to its end.

    A member that fails its check is refused as a whole: what the decoder made of it before it noticed may be
    made-up digits.
    """
    parts: list[bytes] = []
    rest, size, most = stored, 0, _most(len(stored))
    while rest.strip(b"\x00"):  # zero padding may follow
        decoder = new_decoder()
        chunks: list[bytes] = []
        try:
            while rest or chunks:
                chunks.append(decoder.decompress(rest, _CHUNK_BYTES))
                size += len(chunks[-1])
                if size > most:
                    raise too_large(place, size, most)
                rest = getattr(decoder, "unconsumed_tail", b"")
                if decoder.eof or (len(chunks[-1]) < _CHUNK_BYTES and not rest):
                    break
        except (lzma.LZMAError, zlib.error, OSError) as error:
            if parts:
                return Payload(b"".join(parts), f"bytes after the archive cannot be unpacked ({error})")
            raise InputError(place, f"the archive is damaged ({error})", "take another copy of the file") from None
        parts.append(b"".join(chunks))
        if not decoder.eof:
            return Payload(b"".join(parts), "the archive ends early; read up to the break")
        rest = decoder.unused_data
    return Payload(b"".join(parts))


def unpack(stored: bytes, place: str = "archive") -> Payload:
    """Unpack a packed file by its first bytes; anything else is returned as it is, text in UTF-16 as UTF-8.

    Raises InputError at ``place`` when the archive fails its own check.
    """
    decoder = next((d for magic, d in _DECODERS.items() if stored.startswith(magic)), None)
    payload = Payload(stored) if decoder is None else _unpack_members(stored, decoder, place)
    if stored.startswith(ZIP_MAGIC) and is_workbook(io.BytesIO(stored)):
        return Payload(_sheet(stored, place))
    if stored.startswith(ZIP_MAGIC) and (name := only_member(io.BytesIO(stored))):
        payload = Payload(unzipped(io.BytesIO(stored), [name], place)[name])
    return replace(payload, data=_as_utf_8(payload.data))


def _sheet(stored: bytes, place: str) -> bytes:
    """The sheet of a workbook as CSV."""
    with zipfile.ZipFile(io.BytesIO(stored)) as archive:
        size = sum(info.file_size for info in archive.infolist())
    if size > _most(len(stored)):
        raise too_large(place, size, _most(len(stored)))
    return table_of(stored, place)


def _as_utf_8(data: bytes) -> bytes:
    encoding = next((name for name, start in _UTF_16.items() if start.match(data)), "")
    return data.decode(encoding, errors="replace").encode() if encoding else data


def only_member(stored: Path | BinaryIO) -> str:
    """Name of the file in a zip archive that has no other; "" for others."""
    try:
        with zipfile.ZipFile(stored) as archive:
            names = [n for n in archive.namelist() if not n.endswith("/") and not n.startswith("__MACOSX")]
    except UNREADABLE:
        return ""
    return names[0] if len(names) == 1 else ""


def unzipped(stored: Path | BinaryIO, names: Sequence[str], place: str) -> dict[str, bytes]:
    """Contents of these files of a zip archive. InputError at ``place`` for one that is damaged or unpacks to far
    more than a recording."""
    try:
        with zipfile.ZipFile(stored) as archive:
            infos = [archive.getinfo(name) for name in names]
            total = sum(info.file_size for info in infos)
            if total > MOST_BYTES:
                raise too_large(place, total, MOST_BYTES)
            for info in infos:
                if info.file_size > SMALL_BYTES and info.file_size > MOST_RATIO * max(info.compress_size, 1):
                    raise too_large(f"{place}: {info.filename}", info.file_size, MOST_RATIO * info.compress_size)
            found = {}
            for info in infos:
                with archive.open(info) as file:
                    found[info.filename] = file.read(info.file_size + 1)
                if len(found[info.filename]) > info.file_size:  # it says less than it holds
                    raise too_large(f"{place}: {info.filename}", len(found[info.filename]), info.file_size)
            return found
    except UNREADABLE as error:
        if isinstance(error, InputError):
            raise
        raise InputError(place, f"the archive is damaged ({str(error)[:80]})", "take another copy") from None


def head(path: Path) -> bytes:
    """The first HEAD_BYTES of the unpacked content (less when the archive is damaged)."""
    stored = read_file(path, HEAD_BYTES)
    decoder = next((d for magic, d in _DECODERS.items() if stored.startswith(magic)), None)
    try:
        if decoder is not None:
            stored = decoder().decompress(read_file(path) if decoder is bz2.BZ2Decompressor else stored, HEAD_BYTES)
        elif stored.startswith(ZIP_MAGIC) and is_workbook(path):
            return _sheet(read_file(path), str(path))[:HEAD_BYTES]
        elif stored.startswith(ZIP_MAGIC) and (name := only_member(path)):
            with zipfile.ZipFile(path) as archive, archive.open(name) as file:
                stored = file.read(HEAD_BYTES)
    except InputError:  # of a workbook, which ``unpack`` reports
        return stored
    except UNREADABLE:
        return b""
    return _as_utf_8(stored)

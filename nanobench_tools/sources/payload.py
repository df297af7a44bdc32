"""Bytes of a file: plain, gzip or xz, recognised by their first bytes; one that ends early is read up to its end."""

from __future__ import annotations

import hashlib
import lzma
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError

HEAD_BYTES = 8192
"""Enough for the header of every format; only this much is unpacked to recognise a file."""

GZIP_MAGIC, XZ_MAGIC = b"\x1f\x8b", b"\xfd7zXZ\x00"
_GZIP_WINDOW = 16 + zlib.MAX_WBITS

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
        except (lzma.LZMAError, zlib.error) as error:
            if parts:
                return Payload(b"".join(parts), f"bytes after the archive cannot be unpacked ({error})")
            raise InputError(place, f"the archive is damaged ({error})", "take another copy of the file") from None
        parts.append(b"".join(chunks))
        if not decoder.eof:
            return Payload(b"".join(parts), "the archive ends early; read up to the break")
        rest = decoder.unused_data
    return Payload(b"".join(parts))


def unpack(stored: bytes, place: str = "archive") -> Payload:
    """Unpack gzip or xz by their magic; anything else is returned as it is.

    Raises InputError at ``place`` when the archive fails its own check.
    """
    if stored.startswith(XZ_MAGIC):
        return _unpack_members(stored, lzma.LZMADecompressor, place)
    if stored.startswith(GZIP_MAGIC):
        return _unpack_members(stored, lambda: zlib.decompressobj(_GZIP_WINDOW), place)
    return Payload(stored)


def head(path: Path) -> bytes:
    """The first HEAD_BYTES of the unpacked content (less when the archive is damaged)."""
    stored = read_file(path, HEAD_BYTES)
    try:
        if stored.startswith(XZ_MAGIC):
            return lzma.LZMADecompressor().decompress(stored, HEAD_BYTES)
        if stored.startswith(GZIP_MAGIC):
            return zlib.decompressobj(_GZIP_WINDOW).decompress(stored, HEAD_BYTES)
    except (lzma.LZMAError, zlib.error):
        return b""
    return stored

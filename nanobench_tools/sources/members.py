"""Recordings of several files: the files of one recording in a folder, or the same files in a zip archive."""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from ..flight import Flight
from .base import Source
from .payload import UNREADABLE, ZIP_MAGIC, digest, only_member, read_file, unpack, unzipped


@dataclass(frozen=True)
class Gathered:
    """One recording of several files. ``place`` names it in messages, and ``label`` is the path that gives its name.
    ``files`` have their names within it as keys."""

    place: Path
    label: Path
    files: Mapping[str, Path]


@runtime_checkable
class FolderSource(Source, Protocol):
    """A format whose recordings are several files. ``gather`` puts files that it recognised together; ``wanted`` names
    those of an archive that belong to a recording; ``read_members`` gets their unpacked contents by name."""

    def gather(self, paths: Sequence[Path]) -> list[Gathered]: ...

    def wanted(self, names: Sequence[str]) -> list[str]: ...

    def read_members(self, place: Path, members: Mapping[str, bytes]) -> Flight: ...


def members_of(files: Mapping[str, Path], wanted: Callable[[Sequence[str]], list[str]]) -> tuple[dict[str, bytes], str]:
    """Contents by name, of files or of the one archive among them, and where a packed file ends early. InputError that
    names the file."""
    if len(files) == 1 and is_zip(path := next(iter(files.values()))) and not only_member(path):
        return unzipped(path, wanted(names_in(path)), str(path)), ""
    found = {name: unpack(read_file(path), str(path)) for name, path in files.items()}
    return {name: p.data for name, p in found.items()}, "; ".join(p.broken for p in found.values() if p.broken)


def digest_of(members: Mapping[str, bytes]) -> str:
    """SHA-256 of the contents of a recording: that of its only file, else of the digests of all by name.

    A folder and its archive are thus the same recording."""
    if len(members) == 1:
        return digest(next(iter(members.values())))
    listed = "".join(f"{name}\0{digest(members[name])}\n" for name in sorted(members))
    return hashlib.sha256(listed.encode()).hexdigest()


def is_zip(path: Path) -> bool:
    try:
        with open(path, "rb") as file:
            return file.read(len(ZIP_MAGIC)) == ZIP_MAGIC
    except OSError:
        return False


def names_in(path: Path) -> list[str]:
    """Names in a zip archive; empty for one that cannot be opened."""
    try:
        with zipfile.ZipFile(path) as archive:
            return archive.namelist()
    except UNREADABLE:
        return []

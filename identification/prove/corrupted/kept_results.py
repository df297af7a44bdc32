"""What the test bed keeps in the user's cache folder: JSON under a key of its inputs and of the code that made it."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from nanobench_tools.harness.store import Store, encode
from nanobench_tools.results.cache_folder import cache_folder
from nanobench_tools.results.result import from_json

ROOT = Path(__file__).resolve().parents[3]
READING = ("nanobench_tools/sources", "nanobench_tools/auditing", "nanobench_tools/signals",
           "nanobench_tools/time_offsets", "nanobench_tools/flight.py",
           *(f"nanobench_tools/settings/values/{name}.toml" for name in ("audit", "retiming", "sources")))
"""Code that reads, audits and re-times recordings."""
PHYSICS = ("nanobench_tools/physics",)


@functools.cache
def code_hash(places: tuple[str, ...]) -> str:
    """Hash of Python and settings files: of a file, below a folder, or in a folder alone (``folder/*``)."""
    digest = hashlib.sha256()
    for place in places:
        path = ROOT / place
        for file in sorted(path.rglob("*") if path.is_dir() else path.parent.glob(path.name)):
            if file.suffix in (".py", ".toml"):
                digest.update(file.relative_to(ROOT).as_posix().encode() + file.read_bytes())
    return digest.hexdigest()


def key_of(*parts: Any) -> str:
    """Key of JSON values, in their order."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()


def kept(key: str, kind: Any, make: Callable[[], Any]) -> Any:
    """The value of a key (as ``from_json`` reads a ``kind``), made and kept where it is not there yet."""
    store = Store(cache_folder() / "corrupted")
    found = store.get(key)
    if found is None:
        found = encode({"value": make()})
        store.put(key, found)
    return from_json(kind, found["value"])


def hashes(paths: Sequence[Path]) -> list[str]:
    """Content hashes of files."""
    return [hashlib.sha256(path.read_bytes()).hexdigest() for path in paths]

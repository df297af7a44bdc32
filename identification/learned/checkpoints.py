"""Checkpoints: tensors and a JSON header in one safetensors file, written whole or not at all, never unpickled."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from nanobench_tools.errors import InputError
from nanobench_tools.results.result_files import write_bytes

from .libraries import libraries

SCHEMA = "nanobench-learned/1"
PRINTED = 12
"""Characters of a hash that a message shows."""


@dataclass(frozen=True)
class Checkpoint:
    """tensors by name; header: {architecture, data_sha256, settings, ...}."""

    tensors: Mapping[str, np.ndarray]
    header: Mapping[str, Any]

    def part(self, name: str) -> list[np.ndarray]:
        """The arrays saved as ``name/0``, ``name/1``, ... in order."""
        return [self.tensors[f"{name}/{i}"] for i in range(sum(key.startswith(f"{name}/") for key in self.tensors))]


def write(path: Path, parts: Mapping[str, Any], header: Mapping[str, Any]) -> None:
    """``parts``: lists of arrays by name, or single arrays."""
    tensors: dict[str, np.ndarray] = {}
    for name, value in parts.items():
        arrays = value if isinstance(value, list) else None
        tensors |= ({f"{name}/{i}": np.asarray(a, order="C") for i, a in enumerate(arrays)} if arrays is not None
                    else {name: np.asarray(value, order="C")})
    digest = _digest(tensors)
    text = json.dumps({"schema": SCHEMA, "sha256": digest, **header}, sort_keys=True)
    write_bytes(path, libraries().safetensors.save(tensors, {"nanobench": text}))


def read(path: Path) -> Checkpoint:
    """Raises InputError for a file that is missing, cut short, changed, or something else."""
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror or error})") from error
    try:
        size = int.from_bytes(data[:8], "little")
        if not 2 <= size <= len(data) - 8:
            raise ValueError("its header is cut short")
        header = json.loads(json.loads(data[8:8 + size])["__metadata__"]["nanobench"])
        tensors = libraries().safetensors.load(data)
        if header["schema"] != SCHEMA:
            raise ValueError(f"schema {header['schema']!r} where {SCHEMA!r} is needed")
        if header["sha256"] != _digest(tensors):
            raise ValueError("its content is not what was written")
    except Exception as error:  # such a file can make the parser raise anything
        reason = str(error) or type(error).__name__
        raise InputError(str(path), f"is no whole checkpoint ({reason})", "remove it; training starts again") from error
    return Checkpoint(tensors, header)


def check(found: Checkpoint, path: Path, wanted: Mapping[str, Any]) -> None:
    """InputError when the checkpoint is not of ``wanted`` architecture, settings and data."""
    for key, value in wanted.items():
        known = found.header.get(key)
        if known != json.loads(json.dumps(value)):
            raise InputError(str(path), f"has another {key.replace('_', ' ')} ({_short(known)} where {_short(value)} "
                             "is needed)", "give another folder, or remove it to train again")


def _short(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value, sort_keys=True)
    return text[:PRINTED] + "..." if len(text) == 64 else text


def _digest(tensors: Mapping[str, np.ndarray]) -> str:
    digest = hashlib.sha256()
    for name in sorted(tensors):
        value = np.asarray(tensors[name], order="C")
        digest.update(f"{name} {value.dtype.str} {value.shape}".encode() + value.tobytes())
    return digest.hexdigest()

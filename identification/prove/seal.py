"""Truth kept apart from the cases: its hash is written before anything is diagnosed, its text read only afterwards."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

from nanobench_tools.errors import InputError
from nanobench_tools.results.result import from_json, to_json
from nanobench_tools.results.result_files import write_bytes

from .truth import Truth


def text_of(truths: Sequence[Truth]) -> bytes:
    """One JSON list, keys sorted, so that equal truths have equal bytes."""
    return (json.dumps(to_json(list(truths)), sort_keys=True, indent=1, allow_nan=False) + "\n").encode()


def seal(truths: Sequence[Truth]) -> str:
    """SHA-256 of the truths."""
    return hashlib.sha256(text_of(truths)).hexdigest()


def write_truth(truths: Sequence[Truth], path: Path | str) -> str:
    """Write the truths, whole or not at all; returns their seal."""
    write_bytes(Path(path), text_of(truths))
    return seal(truths)


def open_truth(path: Path | str, sealed: str) -> list[Truth]:
    """The truths of a file; raises InputError when they are not those of the seal."""
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}", "give the file with the truth") from None
    if hashlib.sha256(data).hexdigest() != sealed:
        raise InputError(str(path), "its hash is not the one written before the run", "the truth was changed: run anew")
    return [from_json(Truth, truth) for truth in json.loads(data)]

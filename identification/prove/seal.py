"""The hash of the truths, which is written before anything is diagnosed."""

import hashlib
import json
from collections.abc import Sequence

from nanobench_tools.results.result import to_json

from .truth import Truth


def text_of(truths: Sequence[Truth]) -> bytes:
    """One JSON list, keys sorted, so that equal truths have equal bytes."""
    return (json.dumps(to_json(list(truths)), sort_keys=True, indent=1, allow_nan=False) + "\n").encode()


def seal(truths: Sequence[Truth]) -> str:
    """SHA-256 of the truths."""
    return hashlib.sha256(text_of(truths)).hexdigest()

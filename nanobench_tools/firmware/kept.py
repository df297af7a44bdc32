"""Compiled code that is kept between runs, but never longer than any source of this package stays as it is.

Numba keeps machine code by the time stamp of one file, and does not see that a function called from another has
changed. Here the hash of all sources is part of the key.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")


def _hash() -> str:
    files = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in files)).hexdigest()


SOURCES = _hash()


def kept(make: Callable[[str], T]) -> T:
    """What ``make(sources)`` returns: a function compiled with ``cache=True`` whose body mentions ``sources``."""
    return make(SOURCES)

"""Columns of several PX4 topics in one table: ``vehicle_local_position.x``, ``vehicle_attitude_0_q[1]``,
``/vehicle_attitude.00/q.01``."""

from __future__ import annotations

import re
from collections.abc import Iterable

from .known import Known, ecosystem

_BEHIND = re.compile(r"(?:[._]\d+)?[./_](?=[a-z])(.+)")
"""Behind the topic: number of the instance, and the field."""
_ELEMENT = re.compile(r"[._]0*(\d+)$")


def px4_columns(columns: Iterable[str]) -> dict[str, tuple[Known, str]]:
    """Column -> what PX4 says it is, and a title. Of several that give one quantity the first topic of the ecosystem's
    file counts.

    >>> px4_columns(["vehicle_local_position_0.z"])["vehicle_local_position_0.z"][0].quantity
    'z'
    """
    columns = [c for c in columns if "_" in c]
    found: dict[str, tuple[Known, str]] = {}
    for known in ecosystem("px4").names:
        for column in columns if known.topic else ():
            bare = column.removeprefix("/")
            match = _BEHIND.fullmatch(bare.removeprefix(known.topic)) if bare.startswith(known.topic) else None
            if match and known.name in (match[1], _ELEMENT.sub(r"[\1]", match[1])):
                found.setdefault(column, (known, f"PX4 topic {known.topic}"))
    return found

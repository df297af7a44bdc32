"""Columns of several topics of PX4 or messages of MAVLink in one table.

- PX4: ``vehicle_local_position.x``, ``vehicle_attitude_0_q[1]``, ``/vehicle_attitude.00/q.01``
- ROS 2: ``/fmu/out/vehicle_attitude/q[1]``
- MAVLink: ``LOCAL_POSITION_NED.x``
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from .known import Known, ecosystem

_OF_ROS = re.compile(r"(?:.*/)?fmu/(?:in|out)/|/")
"""Before the topic, where ROS 2 carries it."""
_BEHIND = re.compile(r"(?:[._]\d+)?[./_](?=[A-Za-z])(.+)")
"""Behind the topic: number of the instance, and the field."""
_ELEMENT = re.compile(r"[._]0*(\d+)$")
_MAVLINK = re.compile(r"(?:.*[./_])?mavlink_([a-z_]+)_t(?=[./])|(?:.*[./])?(?:SET_)?([A-Z]{3}[A-Z_]*[A-Z])(?=[./_])")
"""The message before a field of MAVLink: in capital letters, or as the type of its C structure."""


def topic_columns(columns: Iterable[str]) -> dict[str, tuple[Known, str]]:
    """Column -> what its topic says it is, and a title. Of several that give one quantity the first topic of the
    ecosystem's file counts.

    >>> topic_columns(["vehicle_local_position_0.z"])["vehicle_local_position_0.z"][0].quantity
    'z'
    """
    columns = [c for c in columns if "_" in c or "." in c or "/" in c]
    found: dict[str, tuple[Known, str]] = {}
    for known in ecosystem("px4").names:
        for column in columns if known.topic else ():
            bare = column[match.end():] if (match := _OF_ROS.match(column)) else column
            if bare.startswith(known.topic) and _is(known, bare.removeprefix(known.topic)):
                found.setdefault(column, (known, f"PX4 topic {known.topic}"))
    of_message = {c: ((match[1] or match[2]).upper(), c[match.end():]) for c in columns if (match := _MAVLINK.match(c))}
    for known in ecosystem("mavlink").names:
        for column, (message, behind) in of_message.items() if known.topic else ():
            if message.removeprefix("SET_") == known.topic and _is(known, behind):
                found.setdefault(column, (known, f"MAVLink message {known.topic}"))
    return found


def _is(known: Known, behind: str) -> bool:
    """Whether what follows the topic is the field."""
    match = _BEHIND.fullmatch(behind)
    return match is not None and known.name in (match[1], _ELEMENT.sub(r"[\1]", match[1]))

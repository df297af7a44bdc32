"""The clock of the messages of a bag: that of their senders, from their headers, where all of these agree with each
other. A sender with another time origin is put on the recorder's clock by the times at which its messages were
received.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

OTHER_CLOCK_S = 1.0
"""A message is received at most so much later than another of the same moment; beyond, the senders' clocks differ: a
convention."""
Messages = Sequence[tuple[int, Any]]
"""(receiving time [ns, Unix], message) each."""


def clocks_of(topics: Mapping[str, Messages]) -> tuple[dict[str, np.ndarray], list[str]]:
    """{topic: times (n,) ns Unix}, and a sentence about every topic that is not on its sender's clock."""
    received = {name: np.array([ns for ns, _ in messages], dtype=np.int64) for name, messages in topics.items()}
    sent = {name: found for name, messages in topics.items() if (found := _sent(messages)) is not None}
    late = {name: float(np.median(received[name] - sent[name])) * 1e-9 for name in sent if len(sent[name])}
    usual = min(late.values(), key=abs, default=0.0)
    times, told = {}, []
    for name, at in received.items():
        if name not in sent:
            times[name] = at
            if len(at) and _has_header(topics[name][0][1]):
                told.append(f"{name}: its headers hold no timestamps; the time at which its messages were received is "
                            "used")
        elif abs(late[name] - usual) > OTHER_CLOCK_S:
            times[name] = sent[name] + round((late[name] - usual) * 1e9)
            first = sent[name][0] * 1e-9
            told.append(f"{name}: its clock differs from the others' (it begins at {first:.3f} s, received at "
                        f"{at[0] * 1e-9:.3f} s). Its timestamps are moved to the times of reception")
        else:
            times[name] = sent[name]
    return times, told


def _has_header(message: Any) -> bool:
    return getattr(getattr(message, "header", None), "stamp", None) is not None


def _sent(messages: Messages) -> np.ndarray | None:
    """(n,) ns of the headers; None where one has none, or zero, or all are alike."""
    if not messages or not all(_has_header(m) for _, m in messages):
        return None
    stamps = np.array([int(m.header.stamp.sec) * 10**9 + int(m.header.stamp.nanosec) for _, m in messages], np.int64)
    return stamps if (stamps > 0).all() and (len(stamps) < 2 or np.ptp(stamps) > 0) else None

"""Where each stream really ends: what lies between its last packet and the last row was made by the resampler.

A log that stops before the recording does is continued by the resampler as a straight line (all columns exactly
linear in time) or held. A straight line that moves is proof enough: no sensor draws one. A held one is proof only for
streams that cannot hold still, because their noise is gone. Commands may hold (a setpoint, motors at 0). A held
command is therefore called dead only from the moment at which the streams with noise died as well.
"""

from dataclasses import dataclass

import numpy as np

from ..flight import Stream, kept_apart
from ..settings import count, number
from .context import Context
from .packet_rows import Packets, packets_of
from .usable_rows import usable_streams

PACKETS = number("audit.dropouts.packets")
SHORTEST_S = number("audit.dropouts.shortest_s")

STRAIGHT_ROWS = count("audit.dropouts.straight_rows")
NO_SENSORS = ("stand",)
"""Thrust stands, for which a constant is plausible."""
BATTERY_HOLDS_S = number("audit.dropouts.battery_holds_s")


@dataclass(frozen=True)
class Dropout:
    """from_s: time of the last packet; to_s: last row; moving: it runs along a straight line rather than standing."""

    from_s: float
    to_s: float
    moving: bool


def holds_still_rightly(name: str, stream: Stream, rows: slice) -> bool:
    """Whether a constant ``stream`` in ``rows`` is no evidence. A setpoint may hold anywhere, motors while all are at
    0 or full, and the attitude controller while it commands nothing. The battery may hold for BATTERY_HOLDS_S (its
    converter has steps of some mV)."""
    if name == "setpoint":
        return True
    values = stream.values[rows]
    if name == "battery":
        times = stream.time_s[rows]
        return len(times) < 2 or times[-1] - times[0] < BATTERY_HOLDS_S
    if name in ("motor", "motor_request", "rpm", "command"):
        return bool(np.all((values <= 0.0) | (values >= 1.0)))
    if name == "pid":
        silent = [q for q in ("roll", "pitch", "cmd_thrust") if q in stream]
        return bool(silent) and not np.any(stream[silent][rows])
    return False


def voltage_stands(context: Context) -> bool:
    """Whether the battery shows one value in the whole recording: stuck, or resting, but no log that ended."""
    stream = context.once(usable_streams).get("battery")
    if stream is None or len(stream) < 2:
        return False
    return bool((stream.values == stream.values[0]).all())


def flies(context: Context) -> bool:
    """Whether the recording has any stream of a vehicle that could fly; a thrust-stand table has none."""
    return any(name in context.flight for name in ("mocap", "imu", "estimator"))


def dropouts_of(context: Context) -> dict[str, Dropout]:
    """The dead end of every stream that has one. The motion capture's own clock is separate from the radio's."""
    streams, packets = context.once(usable_streams), context.once(packets_of)
    last_bend = {name: _last_bend(p) for name, p in packets.items()}
    found: dict[str, Dropout] = {}
    waiting: dict[str, Dropout] = {}
    for name, p in packets.items():
        if name in NO_SENSORS or kept_apart(name):
            continue
        stream, i = streams[name], last_bend[name]
        end = float(stream.time_s[-1])
        if end - stream.time_s[i] < max(SHORTEST_S, PACKETS * p.interval_s) or not np.isfinite(stream.values[i:]).any():
            continue
        moving = not p.still[i + 2 :].all()
        if name == "battery" and not moving and (voltage_stands(context) or not flies(context)):
            continue
        # the line runs through the last two packets: the last one comes one interval after the last bend
        dropout = Dropout(min(float(stream.time_s[i]) + (p.interval_s if moving else 0.0), end), end, moving)
        if moving or not holds_still_rightly(name, stream, slice(i + 1, None)):
            found[name] = dropout
        else:
            waiting[name] = dropout
    radio = [dropout.from_s for name, dropout in found.items() if name not in ("mocap", "battery")]
    if radio:
        stopped = float(np.median(radio))
        for name, dropout in waiting.items():
            if name != "mocap" and dropout.from_s <= stopped + SHORTEST_S:
                found[name] = Dropout(max(dropout.from_s, stopped), dropout.to_s, False)
    return found


def _last_bend(p: Packets) -> int:
    bent = np.flatnonzero(~p.straight[1:-1]) + 1
    if not len(bent):
        return 0
    last = int(bent[-1])
    if last + 2 < len(p.still) and p.still[last + 1 :].all() and len(bent) > 1 and last - bent[-2] >= STRAIGHT_ROWS:
        return int(bent[-2])  # a straight line that is held at its end is one end, not a gap
    return last


def alive_until(context: Context) -> dict[str, float]:
    """Time of the last true value of every stream [s]."""
    dropouts = context.once(dropouts_of)
    return {
        name: dropouts[name].from_s if name in dropouts else float(stream.time_s[-1]) if len(stream) else 0.0
        for name, stream in context.once(usable_streams).items()
    }

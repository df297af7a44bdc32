"""frozen_stream: a stream, or one of its columns, repeats a value for a while and then goes on.

Found by rows that equal the row before exactly. Streams with noise (IMU, estimates) repeat a packet now and then when
the estimator had nothing new: up to 0.09 s in 72 real flights, so 0.15 s is the limit. Commands count only where they
cannot rightly stand (``content.tails.holds_still_rightly``: motors in between 0 and full, requests of an active
controller); a held setpoint is no fault and its freezing cannot be seen, and on a thrust stand everything may. Single
columns are looked at where a sensor's or estimate's step is far below its noise (IMU, estimated position, velocity,
acceleration). The motion capture's repeated poses are ``mocap_occlusion``; standing still to the end is
``dead_stream``.

Size: seconds. Smallest found: 0.15 s; battery 3 s.
"""

from __future__ import annotations

import numpy as np

from ..content.context import Context
from ..content.packets import packets_of
from ..content.rows import runs, usable_streams
from ..content.tails import BATTERY_HOLDS_S, alive_until, holds_still_rightly
from ..flight import Fault, Flight

KIND = "frozen_stream"

SHORTEST_S = 0.15
NEVER_STILL = ("imu", "estimator", "estimator_acc")
"""Streams in which no single column stands still either."""
OTHERS = ("attitude", "attitude_qw", "motor", "motor_request", "rpm", "pid", "command", "battery")


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per frozen stretch of a stream."""
    faults: list[Fault] = []
    if not any(name in flight for name in ("mocap", "imu", "estimator")):
        return faults  # nothing flies
    for name, packets in context.once(packets_of).items():
        if name not in NEVER_STILL + OTHERS:
            continue
        stream = context.once(usable_streams)[name]
        shortest = BATTERY_HOLDS_S if name == "battery" else max(SHORTEST_S, 5.0 * packets.interval_s)
        stretches = {(int(a), int(b)): stream.columns for a, b in runs(packets.still)}
        if name in NEVER_STILL:
            alive = stream.values[stream.time_s <= context.once(alive_until)[name]]
            highest, lowest = np.nan_to_num(alive).max(axis=0), np.nan_to_num(alive).min(axis=0)
            for k, column in enumerate(stream.columns):
                same = np.concatenate(([False], stream.values[1:, k] == stream.values[:-1, k]))
                # standing at the end of the range is saturated_sensor
                same &= (stream.values[:, k] != highest[k]) & (stream.values[:, k] != lowest[k])
                for a, b in runs(same & ~packets.still):
                    stretches.setdefault((int(a), int(b)), ())
                    stretches[int(a), int(b)] += (column,)
        end = context.once(alive_until)[name]
        for (a, b), columns in stretches.items():
            start, stop = float(stream.time_s[a - 1]), float(stream.time_s[b - 1])
            if stop - start < shortest - 1e-6 or start >= end or b >= len(stream):
                continue
            if columns == stream.columns and holds_still_rightly(name, stream, slice(a - 1, b)):
                continue
            what = "all columns" if len(columns) == len(stream.columns) else ", ".join(columns)
            faults.append(
                Fault(
                    KIND,
                    name,
                    columns,
                    start,
                    stop,
                    stop - start,
                    "s",
                    f"{what} of {name} repeat one value in {b - a + 1} rows, {stop - start:.2f} s",
                    shortest,
                )
            )
    return faults

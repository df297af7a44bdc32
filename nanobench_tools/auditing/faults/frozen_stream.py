"""frozen_stream: a stream, or one of its columns, repeats a value for a while and then goes on.

Found by rows that equal the row before exactly. Streams with noise (IMU, estimates) repeat a packet now and then when
the estimator had no new value. This lasts up to 0.09 s in 72 real flights, so 0.15 s is the limit. Commands count only
where they cannot plausibly be constant (``signals.dropouts.holds_still_rightly``: motors in between 0 and full,
requests of an active controller). A held setpoint is no fault, so its freezing cannot be detected. On a test rig every
stream may be constant. Single columns are looked at where a sensor's or estimate's step is far below its noise (IMU,
estimated position, velocity, acceleration). The motion capture's repeated poses are ``mocap_occlusion``. A stream that
is constant to the end is ``dead_stream``. The exception is a battery that shows one value from the first row to the
last while the motors run.

Size: seconds. Smallest found: 0.15 s; battery 3 s.
"""

import numpy as np

from ...flight import Fault, Flight
from ...settings import number
from ...signals.airborne import airborne_spans
from ...signals.context import Context
from ...signals.dropouts import BATTERY_HOLDS_S, alive_until, flies, holds_still_rightly, voltage_stands
from ...signals.packet_rows import packets_of
from ...signals.usable_rows import runs, usable_streams
from .kind import FaultKind

KIND = "frozen_stream"

SHORTEST_S = number("audit.frozen_stream.shortest_s")
NEVER_STILL = ("imu", "estimator", "estimator_acc")
"""Streams in which no single column stands still either."""
OTHERS = ("attitude", "attitude_qw", "motor", "motor_request", "rpm", "pid", "command", "battery")
PACKETS = number("audit.frozen_stream.packets")


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per frozen stretch of a stream."""
    faults: list[Fault] = []
    if not context.once(flies):
        return faults
    faults.extend(_stuck_voltage(context))
    for name, packets in context.once(packets_of).items():
        if name not in NEVER_STILL + OTHERS:
            continue
        stream = context.once(usable_streams)[name]
        shortest = BATTERY_HOLDS_S if name == "battery" else max(SHORTEST_S, PACKETS * packets.interval_s)
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
                Fault(KIND, name, columns, start, stop, stop - start, "s",
                      f"{what} of {name} repeat one value in {b - a + 1} rows, {stop - start:.2f} s", shortest)
            )
    return faults


def _stuck_voltage(context: Context) -> list[Fault]:
    """A fault over the whole recording if the battery never changes while the motors run."""
    streams = context.once(usable_streams)
    if not context.once(voltage_stands) or not _motors_run(context):
        return []
    stream = streams["battery"]
    start, end = float(stream.time_s[0]), float(stream.time_s[-1])
    if end - start < BATTERY_HOLDS_S:
        return []
    evidence = f"{', '.join(stream.columns)} shows one value in all {len(stream)} rows while the motors run"
    return [Fault(KIND, "battery", stream.columns, start, end, end - start, "s", evidence, BATTERY_HOLDS_S)]


def _motors_run(context: Context) -> bool:
    """By their commands or speeds; without these by being in the air."""
    streams = context.once(usable_streams)
    known = [streams[name].values for name in ("motor", "motor_request", "rpm") if name in streams]
    return any(np.nanmax(v, initial=0.0) > 0.0 for v in known) if known else bool(context.once(airborne_spans))


# a battery reading that stands still leaves the other streams as good as they are
FAULT = FaultKind(KIND, find, __doc__,
                  told="{streams} repeated one value {count} ({seconds})",
                  group="lost", cuts=True, spares=frozenset({"battery"}),
                  injection="nanobench_tools.practice.inject.streams:FROZEN_STREAM")

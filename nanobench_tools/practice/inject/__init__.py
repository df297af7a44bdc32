"""Known faults put into recordings, practice or real, so that the audit can be tested against the truth.

``INJECTIONS[kind].function(flight, rng, size, **where) -> (flight, Fault)``; ``FILE_INJECTIONS`` act on the bytes of a
CSV: ``function(data, rng, size) -> (data, Fault)``. The input is never changed. ``stream`` empty in the truth means
all streams of the vehicle (or the file) at once. ``checksum`` belongs to binary logs and has no injection here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from . import clocks, files, room, streams, whole

__all__ = ["FILE_INJECTIONS", "INJECTIONS", "Injection"]


@dataclass(frozen=True)
class Injection:
    """function; sizes worth trying, from near the limit of what can be seen to plain, in ``unit``; (None,) where a size
    makes no sense; ``cases``: further keyword arguments worth trying. The truth's size is what the audit states its
    smallest detectable size in, which for some kinds is not what is asked for here (a share of the peak)."""

    function: Callable[..., Any]
    sizes: tuple[float | None, ...] = (None,)
    unit: str = ""
    cases: tuple[dict[str, Any], ...] = ({},)


INJECTIONS: dict[str, Injection] = {
    "dead_stream": Injection(streams.dead_stream, (1.0, 5.0, 15.0, 25.0), "s",
                             ({}, {"how": "hold"}, {"stream": "imu"}, {"stream": "estimator", "how": "hold"})),
    "frozen_stream": Injection(streams.frozen_stream, (0.2, 0.5, 2.0), "s"),
    "gap": Injection(streams.gap, (0.15, 0.5, 2.0), "s", ({}, {"stream": "mocap"}, {"stream": "imu"})),
    "duplicate_time": Injection(clocks.duplicate_time, (1, 3, 20), "rows"),
    "backward_time": Injection(clocks.backward_time, (0.005, 0.05, 1.0), "s"),
    "clock_offset": Injection(clocks.clock_offset, (-0.1, -0.03, 0.01, 0.05, 0.1), "s"),
    "clock_drift": Injection(clocks.clock_drift, (-0.003, 0.001, 0.005), "s/s"),
    "clock_wander": Injection(clocks.clock_wander, (0.01, 0.03, 0.06), "s"),
    "unit": Injection(streams.unit, cases=tuple({"case": i} for i in range(len(streams.WRONG_UNITS)))),
    "sign": Injection(streams.sign,
                      cases=tuple({"stream": s, "column": c} for s, cs in streams.SIGNED.items() for c in cs)),
    "axis_swap": Injection(streams.axis_swap,
                           cases=tuple({"stream": s, "pair": p} for s, ps in streams.SWAPPED.items() for p in ps)),
    "spike": Injection(streams.spike, (0.05, 0.2, 1.0), "1 m, 1 rad, 40 m/s^2, 20 rad/s, 1 V",
                       tuple({"stream": s} for s in streams.SPIKED)),
    "saturated_sensor": Injection(streams.saturated_sensor, (0.2, 0.4, 0.6), "share of the peak"),
    "mocap_occlusion": Injection(room.mocap_occlusion, (0.1, 0.5, 2.0), "s",
                                 ({"how": "repeat"}, {"how": "interpolate"}, {"how": "nan"})),
    "mocap_jump": Injection(room.mocap_jump, (0.02, 0.1, 0.5), "m"),
    "quaternion_order": Injection(room.quaternion_order, cases=({"stream": "mocap"}, {"stream": "attitude_qw"})),
    "estimator_reset": Injection(whole.estimator_reset, (0.15, 0.5, 2.0), "m"),
    "never_flew": Injection(whole.never_flew),
    "crash": Injection(whole.crash, (0.5, 1.0), "share of the blow"),
    "copy": Injection(whole.copy),
    "missing_column": Injection(streams.missing_column),
}
"""Kind of fault -> how to put it into a Flight."""

FILE_INJECTIONS: dict[str, Injection] = {
    "missing_column": Injection(files.missing_column, (1, 5), "columns"),
    "extra_column": Injection(files.extra_column, (1, 3), "columns"),
    "truncated": Injection(files.truncated, (0.001, 0.1, 0.6), "share of the bytes"),
    "bad_cell": Injection(files.bad_cell, (1, 10), "cells", ({}, {"ragged": True})),
}
"""Kind of fault -> how to put it into the bytes of a NanoBench CSV."""

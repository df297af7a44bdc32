"""Faults of single streams: ended, frozen, missing, spiked, clipped, in another unit, sign or order."""

import math

import numpy as np

from ...auditing.faults.kind import Blind, Injection
from ...flight import Fault, Flight
from .place import FIRMWARE, NOISY, TAIL_S, choose, choose_time, several, truth, with_values


def dead_stream(flight: Flight, rng: np.random.Generator, size: float = 10.0, *, stream: str = "",
                at_s: float | None = None, how: str = "extrapolate") -> tuple[Flight, Fault]:
    """The log stops ``size`` s before the end (or at ``at_s``). Its rows go on as a straight line or are held.

    stream: the empty name means all streams of the vehicle at once, as in the real recordings.
    """
    end = flight.span.end_s
    at = end - size if at_s is None else at_s
    start = at
    for name in several(flight, stream):
        s = flight[name]
        i = max(int(np.searchsorted(s.time_s, at, side="right")) - 1, 1)
        slope = (s.values[i] - s.values[i - 1]) / (s.time_s[i] - s.time_s[i - 1])
        if how == "hold":
            slope = 0.0 * slope
        values = s.values.copy()
        values[i + 1:] = s.values[i] + np.multiply.outer(s.time_s[i + 1:] - s.time_s[i], slope)
        start = float(s.time_s[i])
        flight = flight.with_streams(**{name: with_values(s, values)})
    what = f"log ended at {start:.2f} s, {how}"
    return flight, truth("dead_stream", stream, (), (start, end), end - start, "s", what)


def frozen_stream(flight: Flight, rng: np.random.Generator, size: float = 1.0, *, stream: str | None = None,
                  at_s: float | None = None) -> tuple[Flight, Fault]:
    """One stream repeats its value for ``size`` s, then goes on."""
    name = choose(rng, stream, NOISY, flight)
    at = choose_time(flight, rng, at_s, size)
    s = flight[name]
    rows = np.flatnonzero((s.time_s >= at) & (s.time_s <= at + size))
    values = s.values.copy()
    values[rows] = values[rows[0]]
    span = float(s.time_s[rows[0]]), float(s.time_s[rows[-1]])
    return (flight.with_streams(**{name: with_values(s, values)}),
            truth("frozen_stream", name, s.columns, span, span[1] - span[0], "s", "value repeated"))


def gap(flight: Flight, rng: np.random.Generator, size: float = 0.5, *, stream: str | None = None,
        at_s: float | None = None) -> tuple[Flight, Fault]:
    """No packets for ``size`` s: a straight line between the neighbours; for ``mocap`` the rows of all streams go."""
    name = choose(rng, stream, ("mocap", *FIRMWARE[:-1]), flight)
    at = choose_time(flight, rng, at_s, size)
    s = flight[name]
    inner = np.flatnonzero((s.time_s > at) & (s.time_s < at + size))
    before, after = inner[0] - 1, min(inner[-1] + 1, len(s) - 1)
    span = float(s.time_s[before]), float(s.time_s[after])
    fault = truth("gap", name, s.columns, span, span[1] - span[0], "s", "no samples")
    if name == "mocap":
        return flight.with_streams(**{n: x.rows(~((x.time_s > span[0]) & (x.time_s < span[1])))
                                      for n, x in flight.streams.items()}), fault
    values = s.values.copy()
    share = ((s.time_s[inner] - span[0]) / (span[1] - span[0]))[:, None]
    values[inner] = values[before] + share * (values[after] - values[before])
    return flight.with_streams(**{name: with_values(s, values)}), fault


SPIKED = {"mocap": ("px", "py", "pz"), "imu": ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z"),
          "estimator": ("x", "y", "z"), "attitude": ("roll", "pitch"), "battery": ("vbat",)}
SPIKE_UNIT = {"px": 1.0, "py": 1.0, "pz": 1.0, "x": 1.0, "y": 1.0, "z": 1.0, "vbat": 1.0, "roll": 1.0, "pitch": 1.0,
              **dict.fromkeys(("acc_x", "acc_y", "acc_z"), 40.0), **dict.fromkeys(("gyro_x", "gyro_y", "gyro_z"), 20.0)}
"""What a spike of size 1 is in the SI unit of the quantity."""


def spike(flight: Flight, rng: np.random.Generator, size: float = 1.0, *, stream: str | None = None,
          column: str | None = None, at_s: float | None = None) -> tuple[Flight, Fault]:
    """One row of one column is off by ``size`` (in SPIKE_UNITs: 1 m, 1 rad, 40 m/s^2, 20 rad/s, 1 V), random sign."""
    name = choose(rng, stream, tuple(SPIKED), flight)
    column = column or SPIKED[name][int(rng.integers(len(SPIKED[name])))]
    s = flight[name]
    i = int(np.searchsorted(s.time_s, choose_time(flight, rng, at_s)))
    amount = size * SPIKE_UNIT.get(column, 1.0) * (1.0 if rng.uniform() < 0.5 else -1.0)
    values = s.values.copy()
    values[i, s.index(column)] += amount
    at = float(s.time_s[i])
    return (flight.with_streams(**{name: with_values(s, values)}),
            truth("spike", name, (s.columns[s.index(column)],), (at, at), abs(amount), s.unit[s.index(column)],
                  "one row off"))


def saturated_sensor(flight: Flight, rng: np.random.Generator, size: float = 0.5, *, stream: str = "imu",
                     column: str | None = None) -> tuple[Flight, Fault]:
    """One column is clipped at ``size`` times its largest deviation from its median (rates: from zero), both ways.

    The continued line at the end is left alone: a range limits readings. The truth is the end of the range that more
    rows meet; its size is their number.
    """
    s = flight[stream]
    column = column or ("gyro_x", "gyro_y", "acc_x", "acc_y", "acc_z")[int(rng.integers(5))]
    i = s.index(column)
    x = s.values[:, i]
    read = s.time_s < s.time_s[-1] - TAIL_S
    centre = float(np.median(x[read])) if column.startswith("acc") else 0.0
    limit = size * float(np.max(np.abs(x[read] - centre)))
    values = s.values.copy()
    values[read, i] = np.clip(x[read], centre - limit, centre + limit)
    rows = max((np.flatnonzero(read & (values[:, i] == centre + side * limit)) for side in (-1.0, 1.0)), key=len)
    span = float(s.time_s[rows[0]]), float(s.time_s[rows[-1]])
    return (flight.with_streams(**{stream: with_values(s, values)}),
            truth("saturated_sensor", stream, (s.columns[i],), span, len(rows), "rows",
                  f"clipped at {limit:.4g} {s.unit[i]} from {centre:.4g}"))


WRONG_UNITS: tuple[tuple[str, tuple[str, ...], float, str], ...] = (
    ("attitude", ("roll", "pitch", "yaw"), 180.0 / math.pi, "deg taken as rad"),
    ("attitude", ("roll", "pitch", "yaw"), math.pi / 180.0, "rad taken as deg"),
    ("imu", ("gyro_x", "gyro_y", "gyro_z"), 180.0 / math.pi, "deg/s taken as rad/s"),
    ("imu", ("gyro_x", "gyro_y", "gyro_z"), math.pi / 180.0, "rad/s taken as deg/s"),
    ("imu", ("acc_x", "acc_y", "acc_z"), 9.81, "m/s^2 taken as g"),
    ("imu", ("acc_x", "acc_y", "acc_z"), 1.0 / 9.81, "g taken as m/s^2"),
    ("mocap", ("px", "py", "pz"), 1000.0, "mm taken as m"),
    ("estimator", ("x", "y", "z"), 1000.0, "mm taken as m"),
    ("estimator", ("vx", "vy", "vz"), 1000.0, "mm/s taken as m/s"),
    ("battery", ("vbat",), 1000.0, "mV taken as V"),
    ("motor", ("m1", "m2", "m3", "m4"), 1.0 / 65535.0, "ratio taken as counts"),
)
"""Stream, quantities, factor on the values, what went wrong."""


def unit(flight: Flight, rng: np.random.Generator, size: float | None = None, *, case: int | None = None
         ) -> tuple[Flight, Fault]:
    """Columns of one stream in another unit: one of WRONG_UNITS (``case``, else random); ``size`` is not used: the
    truth's size is the factor."""
    name, quantities, factor, what = WRONG_UNITS[int(rng.integers(len(WRONG_UNITS))) if case is None else case]
    s = flight[name]
    columns = [s.index(q) for q in quantities]
    values = s.values.copy()
    values[:, columns] *= factor
    return (flight.with_streams(**{name: with_values(s, values)}),
            truth("unit", name, [s.columns[i] for i in columns], (s.span.start_s, s.span.end_s), factor, "1", what))


SIGNED = {"imu": ("gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y", "acc_z"), "attitude": ("roll", "pitch"),
          "estimator": ("x", "y", "vx", "vy"), "estimator_acc": ("ax", "ay")}


def sign(flight: Flight, rng: np.random.Generator, size: float | None = None, *, stream: str | None = None,
         column: str | None = None) -> tuple[Flight, Fault]:
    """One column of one stream is negated; ``size`` is not used."""
    name = choose(rng, stream, tuple(SIGNED), flight)
    s = flight[name]
    i = s.index(column or SIGNED[name][int(rng.integers(len(SIGNED[name])))])
    values = s.values.copy()
    values[:, i] *= -1.0
    return (flight.with_streams(**{name: with_values(s, values)}),
            truth("sign", name, (s.columns[i],), (s.span.start_s, s.span.end_s), -1.0, "1", "negated"))


SWAPPED = {"imu": (("gyro_x", "gyro_y"), ("gyro_y", "gyro_z"), ("acc_x", "acc_y"), ("acc_y", "acc_z")),
           "estimator": (("x", "y"), ("y", "z"), ("vx", "vy")), "attitude": (("roll", "pitch"),)}


def axis_swap(flight: Flight, rng: np.random.Generator, size: float | None = None, *, stream: str | None = None,
              pair: tuple[str, str] | None = None) -> tuple[Flight, Fault]:
    """Two columns of one stream change places; ``size`` is not used."""
    name = choose(rng, stream, tuple(SWAPPED), flight)
    s = flight[name]
    i, j = map(s.index, pair or SWAPPED[name][int(rng.integers(len(SWAPPED[name])))])
    values = s.values.copy()
    values[:, [i, j]] = values[:, [j, i]]
    return (flight.with_streams(**{name: with_values(s, values)}),
            truth("axis_swap", name, (s.columns[i], s.columns[j]), (s.span.start_s, s.span.end_s), float("nan"), "",
                  "columns exchanged"))


def missing_column(flight: Flight, rng: np.random.Generator, size: float | None = None, *, stream: str | None = None,
                   column: str | None = None) -> tuple[Flight, Fault]:
    """One column is not there at all; ``size`` is not used."""
    name = choose(rng, stream, FIRMWARE[:-1], flight)
    s = flight[name]
    gone = s.index(column) if column else int(rng.integers(len(s.columns)))
    keep = [i for i in range(len(s.columns)) if i != gone]
    left = type(s)(s.time_s, s.values[:, keep], tuple(s.columns[i] for i in keep), tuple(s.quantities[i] for i in keep),
                   tuple(s.unit[i] for i in keep), s.frame, s.rate_hz, s.samples, s.valid)
    return (flight.with_streams(**{name: left}),
            truth("missing_column", name, (s.columns[gone],), (s.span.start_s, s.span.end_s), 1.0, "columns",
                  "left out"))


DEAD_STREAM = Injection(dead_stream,
                        (1.0, 5.0, 15.0, 25.0),
                        "s",
                        ({}, {"how": "hold"}, {"stream": "imu"}, {"stream": "estimator", "how": "hold"}),
                        blind=(Blind(6.0, {}, False, place=7),))
FROZEN_STREAM = Injection(frozen_stream, (0.2, 0.5, 2.0), "s", blind=(Blind(2.0, {}, False, place=14),))
GAP = Injection(
    gap, (0.15, 0.5, 2.0), "s", ({}, {"stream": "mocap"}, {"stream": "imu"}), blind=(Blind(2.0, {}, False, place=12),)
)
UNIT = Injection(unit,
                 cases=tuple({"case": i} for i in range(len(WRONG_UNITS))),
                 blind=(Blind(None, {"case": 0}, True, place=0), Blind(None, {"case": 3}, True, place=1),
                        Blind(None, {"case": 5}, True, place=2), Blind(None, {"case": 10}, True, place=15)))
SIGN = Injection(sign,
                 cases=tuple({"stream": s, "column": c} for s, cs in SIGNED.items() for c in cs),
                 blind=(Blind(None, {"stream": "imu", "column": "gyro_x"}, True, place=3),
                        Blind(None, {"stream": "imu", "column": "acc_y"}, True, place=4)))
AXIS_SWAP = Injection(axis_swap,
                      cases=tuple({"stream": s, "pair": p} for s, ps in SWAPPED.items() for p in ps),
                      blind=(Blind(None, {"stream": "imu", "pair": ("gyro_x", "gyro_y")}, True, place=9),))
SPIKE = Injection(spike,
                  (0.05, 0.2, 1.0),
                  "1 m, 1 rad, 40 m/s^2, 20 rad/s, 1 V",
                  tuple({"stream": s} for s in SPIKED),
                  blind=(Blind(1.0, {}, False, place=8),))
SATURATED_SENSOR = Injection(
    saturated_sensor, (0.2, 0.4, 0.6), "share of the peak", blind=(Blind(0.4, {}, False, place=16),)
)
MISSING_COLUMN = Injection(missing_column)

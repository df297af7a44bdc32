"""The one data model: a Flight holds Streams, each with its own clock, and Spans and Faults say what holds where.

Inside everything is SI and in the convention of ``frames``. Times are seconds from the first row of the
recording; ``Flight.epoch_s`` is the absolute (Unix) time of that row.
"""

from __future__ import annotations

import hashlib
import importlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike

from .errors import InputError
from .lookup.deprecation import warn_renamed
from .results.dataframes import arrays_of, frame_of, one_grid
from .results.flight_figure import flight_figure, named_in

if TYPE_CHECKING:
    import pandas as pd

def _each(names: str, unit: str, frame: str) -> dict[str, tuple[str, str]]:
    return dict.fromkeys(names.split(), (unit, frame))


_MOTORS = tuple(f"m{i}" for i in range(1, 9))
STREAM_QUANTITIES: dict[str, dict[str, tuple[str, str]]] = {
    "mocap": {**_each("px py pz", "m", "world"), **_each("qx qy qz qw", "1", "world"),
              **_each("roll pitch yaw", "rad", "world"), **_each("vx vy vz", "m/s", "world"),
              **_each("wx wy wz", "rad/s", "body")},
    "imu": {**_each("acc_x acc_y acc_z", "m/s^2", "body"), **_each("gyro_x gyro_y gyro_z", "rad/s", "body")},
    "motor": _each(" ".join(_MOTORS), "1", "motor"),
    "motor_request": _each(" ".join(_MOTORS), "1", "motor"),
    "estimator": {**_each("x y z", "m", "world"), **_each("vx vy vz", "m/s", "world")},
    "estimator_acc": _each("ax ay az", "m/s^2", "world"),
    "attitude": _each("roll pitch yaw", "rad", "world"),
    "attitude_qw": _each("qx qy qz qw", "1", "world"),
    "setpoint": {**_each("x y z", "m", "world"), **_each("yaw", "rad", "world")},
    "pid": {**_each("roll pitch yaw", "rad", "world"), **_each("cmd_thrust", "1", "body")},
    "battery": {**_each("vbat", "V", "-"), **_each("current", "A", "-")},
    "rpm": _each(" ".join(_MOTORS), "rad/s", "motor"),
    "command": _each("thrust", "1", "body"),
    "stand": {**_each("thrust", "N", "body"), **_each("current", "A", "-")},
}
for _name, _known in STREAM_QUANTITIES.items():
    if _name not in ("mocap", "stand"):
        _known["tick"] = ("s", "-")
"""The vocabulary: stream -> quantity -> (SI unit, frame). Columns of a source are mapped onto these.

``tick``: the sender's timestamp of a sample, if it was logged in addition to the receiver's. ``motor``: what the motors
got (after battery compensation), m1 to at most m8. ``motor_request``: the request before it. ``command``: the
collective set-point of all (``Stream.unit`` is 1 for a fraction of full, or N). ``stand``: the load cell of the test
rig (sum over the motors). ``estimator_acc`` excludes gravity.
"""


def kept_apart(stream: str) -> bool:
    """Whether a stream of this name is outside the vocabulary: kept as found, used by no task, never a reason to cut.

    >>> kept_apart("extra_leica0"), kept_apart("imu")
    (True, False)
    """
    return stream == "extra" or stream.startswith("extra_")


LONGEST_NAME = 120
"""Characters of a name that a ``repr`` shows."""


def motors_of(stream: Stream) -> tuple[str, ...]:
    """m1, m2 ... of a stream of motors, as far as they are there without a hole."""
    there = [name in stream.quantities for name in _MOTORS]
    return _MOTORS[:there.index(False) if False in there else len(there)]


@dataclass(frozen=True, order=True)
class Span:
    """A stretch of time of a recording, ends included.

    Attributes
    ----------
    start_s, end_s : float
        s from the first row of the recording.
    """

    start_s: float
    end_s: float

    @property
    def duration_s(self) -> float:
        """``end_s - start_s``, s."""
        return self.end_s - self.start_s

    def mask(self, time_s: np.ndarray) -> np.ndarray:
        """Return which times lie in the span.

        Parameters
        ----------
        time_s : ndarray
            (n,) s from the first row of the recording.

        Returns
        -------
        ndarray
            (n,) bool, ends included.
        """
        return (time_s >= self.start_s) & (time_s <= self.end_s)


def mask_of(spans: Iterable[Span], time_s: np.ndarray) -> np.ndarray:
    """(n,) bool: which of ``time_s`` lie in any of ``spans``."""
    inside = np.zeros(len(time_s), dtype=bool)
    for span in spans:
        inside |= span.mask(time_s)
    return inside


def merge_spans(spans: Iterable[Span]) -> tuple[Span, ...]:
    """Sorted union; touching spans become one, empty ones vanish."""
    merged: list[Span] = []
    for span in sorted(s for s in spans if s.end_s > s.start_s):
        if merged and span.start_s <= merged[-1].end_s:
            merged[-1] = Span(merged[-1].start_s, max(merged[-1].end_s, span.end_s))
        else:
            merged.append(span)
    return tuple(merged)


def intersect_spans(a: Iterable[Span], b: Iterable[Span]) -> tuple[Span, ...]:
    """Where both hold."""
    return merge_spans(Span(max(x.start_s, y.start_s), min(x.end_s, y.end_s))
                       for x in a for y in b if min(x.end_s, y.end_s) > max(x.start_s, y.start_s))


def subtract_spans(a: Iterable[Span], b: Iterable[Span]) -> tuple[Span, ...]:
    """Where ``a`` holds and ``b`` does not."""
    left = list(merge_spans(a))
    for cut in merge_spans(b):
        left = [piece for s in left for piece in
                (Span(s.start_s, min(s.end_s, cut.start_s)), Span(max(s.start_s, cut.end_s), s.end_s))
                if piece.end_s > piece.start_s]
    return tuple(left)


@dataclass(frozen=True)
class Fault:
    """One error in the data (or, for ``interpolated``, a useful fact).

    Attributes
    ----------
    kind : str
        Name of the fault; the reference has a page of all kinds.
    stream : str
        Stream of the vocabulary; empty if it concerns the whole recording.
    columns : tuple of str
        Columns of the source that are affected.
    start_s, end_s : float
        Its span, s from the first row.
    size : float
        In ``unit``; nan where a size makes no sense.
    unit : str
        Of ``size`` and ``minimum_detectable``.
    evidence : str
        One sentence that a person can check.
    minimum_detectable : float
        The smallest size that this check finds on this stream, in ``unit``; nan as ``size``.
    """

    kind: str
    stream: str
    columns: tuple[str, ...]
    start_s: float
    end_s: float
    size: float
    unit: str
    evidence: str
    minimum_detectable: float = float("nan")

    @property
    def span(self) -> Span:
        """From ``start_s`` to ``end_s``."""
        return Span(self.start_s, self.end_s)


@dataclass(frozen=True, repr=False)
class Stream:
    """Samples of one message of the vehicle or of the motion capture, on their own clock.

    Attributes
    ----------
    time_s : ndarray
        (n,) s from the first row of the recording, non-decreasing unless a fault reports otherwise.
    values : ndarray
        (n, k) in SI units; nan where a value is missing.
    columns : tuple of str
        (k) names of the source.
    quantities : tuple of str
        (k) names in ``STREAM_QUANTITIES``.
    unit : tuple of str
        (k) SI units.
    frame : str
        ``world``, ``body``, ``motor`` or ``-``.
    rate_hz : float
        True rate of the sensor, Hz.
    samples : int or None
        Number of values that were really sent, without interpolated rows; None if unknown.
    valid : tuple of Span or None
        Spans without a known objection; None: everywhere.
    time_sd_s : ndarray or None
        (n,) s, uncertainty of a corrected ``time_s``; None: timestamps as recorded.
    """

    time_s: np.ndarray
    values: np.ndarray
    columns: tuple[str, ...]
    quantities: tuple[str, ...]
    unit: tuple[str, ...]
    frame: str = "-"
    rate_hz: float = float("nan")
    samples: int | None = None
    valid: tuple[Span, ...] | None = None
    time_sd_s: np.ndarray | None = None

    def __post_init__(self) -> None:
        n, k = len(self.time_s), len(self.columns)
        if self.values.shape != (n, k) or len(self.quantities) != k or len(self.unit) != k:
            raise ValueError(f"stream of {n} rows and {k} columns got values {self.values.shape}, "
                             f"{len(self.quantities)} quantities and {len(self.unit)} units")

    def __len__(self) -> int:
        return len(self.time_s)

    def __repr__(self) -> str:
        span = f", {self.span.start_s:.2f} to {self.span.end_s:.2f} s, {self.rate_hz:.4g} Hz" if len(self) else ""
        return f"Stream of {len(self)} rows{span}: {named_in(self.quantities, 12)}"

    def __contains__(self, name: str) -> bool:
        return name in self.quantities or name in self.columns

    def index(self, name: str) -> int:
        """Return the column number of a quantity or of a source column.

        Parameters
        ----------
        name : str
            Such as ``px``, or as the source writes it.

        Returns
        -------
        int
            Column of ``values``.

        Raises
        ------
        KeyError
            For an unknown name; the message lists the known ones.
        """
        if name in self.quantities:
            return self.quantities.index(name)
        if name in self.columns:
            return self.columns.index(name)
        raise KeyError(f"no {name!r} in this stream; it has {', '.join(self.quantities)}")

    def __getitem__(self, names: str | Sequence[str]) -> np.ndarray:
        """``stream["px"]`` -> (n,); ``stream["px", "py", "pz"]`` -> (n, 3). Quantities or source columns."""
        if isinstance(names, str):
            return self.values[:, self.index(names)]
        return self.values[:, [self.index(name) for name in names]]

    @property
    def span(self) -> Span:
        """From the first to the last timestamp; 0 to 0 without rows."""
        if not len(self):
            return Span(0.0, 0.0)
        return Span(float(self.time_s[0]), float(self.time_s[-1]))

    def rows(self, keep: np.ndarray) -> Stream:
        """Return some rows as a stream.

        Parameters
        ----------
        keep : ndarray
            (n,) bool, or indices of rows.

        Returns
        -------
        Stream
            ``samples`` is scaled by the share of rows that are kept.
        """
        time_s = self.time_s[keep]
        samples = None if self.samples is None or not len(self) else round(self.samples * len(time_s) / len(self))
        sd = None if self.time_sd_s is None else self.time_sd_s[keep]
        return replace(self, time_s=time_s, values=self.values[keep], samples=samples, time_sd_s=sd)

    def during(self, spans: Span | Iterable[Span]) -> Stream:
        """Return the rows inside spans.

        Parameters
        ----------
        spans : Span or iterable of Span
            s from the first row of the recording, ends included.

        Returns
        -------
        Stream
            On the same time axis.
        """
        return self.rows(mask_of([spans] if isinstance(spans, Span) else spans, self.time_s))

    def interpolate(self, names: str | Sequence[str], at_s: np.ndarray) -> np.ndarray:
        """Interpolate linearly; beyond its ends a stream keeps its first and last values.

        Not for quaternions (``so3.interpolate``) and not for angles that wrap.

        Parameters
        ----------
        names : str or sequence of str
            Quantities or source columns.
        at_s : ndarray
            (m,) s from the first row of the recording.

        Returns
        -------
        ndarray
            (m,) for one name, (m, len(names)) for several, SI.

        Raises
        ------
        KeyError
            For an unknown name.
        """
        if isinstance(names, str):
            return np.asarray(np.interp(at_s, self.time_s, self[names]))
        return np.stack([np.interp(at_s, self.time_s, self[name]) for name in names], axis=1)

    def to_pandas(self) -> pd.DataFrame:
        """A DataFrame: index seconds, columns (quantity, unit); ``attrs`` hold units, frame and rate."""
        return frame_of(self.time_s, self.values, self.quantities, self.unit,
                        {"frame": self.frame, "rate_hz": self.rate_hz, "samples": self.samples})


@dataclass(frozen=True)
class Assumption:
    """The unit of a column that neither its name nor its numbers show.

    Attributes
    ----------
    stream, column : str
        Where it was assumed.
    unit : str
        The assumed unit.
    why : str
        The reason, as a sentence.
    """

    stream: str
    column: str
    unit: str
    why: str


@dataclass(frozen=True)
class Provenance:
    """Origin of a flight.

    Attributes
    ----------
    path : str
        The file, for messages.
    sha256 : str
        Hash of the content.
    source : str
        Name of the source that read it.
    synthetic : bool
        True for simulated flights.
    findings : tuple of Fault
        Faults seen while reading.
    notes : tuple of str
        Sentences of the reader.
    clock_evidence : tuple of str
        Kinds of streams that were used to estimate the clock of the timestamps; empty as recorded.
    assumptions : tuple of Assumption
        Units that the data do not show.
    added : tuple of str
        Sentences on columns that were computed or assumed after reading.
    """

    path: str
    sha256: str
    source: str
    synthetic: bool = False
    findings: tuple[Fault, ...] = ()
    notes: tuple[str, ...] = ()
    clock_evidence: tuple[str, ...] = ()
    assumptions: tuple[Assumption, ...] = ()
    added: tuple[str, ...] = ()


@dataclass(frozen=True, repr=False)
class Flight:
    """One recording.

    ``flight["imu"]`` is a stream, ``flight[2.0:6.0]`` the flight from 2 to 6 s, on the same time axis.

    Attributes
    ----------
    name : str
        Labels rows and never affects a decision.
    streams : mapping of str to Stream
        By name in ``STREAM_QUANTITIES``; ``extra_NAME`` for other streams, which no task uses.
    metadata : mapping
        The recording's sheet as found. Where known, it also has ``family`` (trajectory type), ``speed`` (slow, medium,
        fast), ``reference_speed_m_s`` and ``repetition``.
    provenance : Provenance
        Where it is from, and what was seen or assumed while reading.
    epoch_s : float
        Unix time of the first row, s.
    """

    name: str
    streams: Mapping[str, Stream]
    metadata: Mapping[str, Any]
    provenance: Provenance
    epoch_s: float = 0.0

    def __contains__(self, stream: str) -> bool:
        return stream in self.streams

    @overload
    def __getitem__(self, key: str) -> Stream: ...
    @overload
    def __getitem__(self, key: slice) -> Flight: ...
    def __getitem__(self, key: str | slice) -> Stream | Flight:
        """A stream by name, or an InputError that names the flight and what it has; or a span of time, s."""
        if isinstance(key, slice):
            return self.during(_span_of(key))
        try:
            return self.streams[key]
        except KeyError:
            raise InputError(self.provenance.path, f"has no {key} stream",
                             f"it has {', '.join(self.streams) or 'none'}") from None

    def __repr__(self) -> str:
        kind = "SYNTHETIC " if self.provenance.synthetic else ""
        name = self.name if len(self.name) <= LONGEST_NAME else f"{self.name[:LONGEST_NAME - 3]}..."
        return (f"{kind}Flight {name!r}, {self.duration_s:.1f} s, {self.provenance.source}: "
                f"{named_in(tuple(self.streams), 16)}")

    def keys(self) -> tuple[str, ...]:
        """The names of its streams."""
        return tuple(self.streams)

    @property
    def duration_s(self) -> float:
        """From the first to the last timestamp of any stream, s."""
        return self.span.duration_s

    def plot(self) -> Any:
        """A plotly figure (extra ``report``): position, gyro, motors and battery over time."""
        return flight_figure(self.name, self.streams)

    @property
    def span(self) -> Span:
        """From the first to the last timestamp of any stream."""
        spans = [s.span for s in self.streams.values() if len(s)]
        return Span(min(s.start_s for s in spans), max(s.end_s for s in spans)) if spans else Span(0.0, 0.0)

    def to_pandas(self, rate_hz: float = 100.0) -> pd.DataFrame:
        """Return all streams on one grid.

        Values between samples are interpolated linearly, angles by the shorter way, quaternions by slerp.

        Parameters
        ----------
        rate_hz : float
            Rows per second.

        Returns
        -------
        pandas.DataFrame
            Index: s. Columns (stream.quantity, unit), nan outside a stream's own time. ``stream.interpolated`` is 1 in
            rows further from any sample than half a step.

        Raises
        ------
        InputError
            Where no stream has two rows.
        """
        return one_grid(self.name, self.streams, rate_hz)

    @classmethod
    def from_pandas(cls, frames: Mapping[str, pd.DataFrame], units: Mapping[str, Mapping[str, str]] | None = None,
                    name: str = "flight", metadata: Mapping[str, Any] | None = None) -> Flight:
        """Make a flight of DataFrames. Rows are unchanged: the audit finds timestamps that do not rise.

        Parameters
        ----------
        frames : mapping of str to pandas.DataFrame
            By stream, such as ``{"mocap": df}``; columns are quantities of ``STREAM_QUANTITIES``. The index is seconds,
            timedeltas or dates; the earliest row becomes time zero.
        units : mapping, optional
            {stream: {quantity: unit}}, with units such as ``deg``, ``g``, ``mV``, ``pwm16``. The default is the
            columns' second level, else SI.
        name : str
            Of the flight.
        metadata : mapping, optional
            As of ``Flight``.

        Returns
        -------
        Flight
            In SI units.

        Raises
        ------
        InputError
            With stream, column and row.
        """
        strange = next((s for s in {**frames, **(units or {})} if s not in STREAM_QUANTITIES), None)
        if strange is not None:
            raise InputError(f"DataFrame of {strange}", "is no stream", f"known: {', '.join(STREAM_QUANTITIES)}")
        found = {s: arrays_of(s, frame, STREAM_QUANTITIES[s], (units or {}).get(s)) for s, frame in frames.items()}
        filled = {s: parts for s, parts in found.items() if len(parts[0])}
        if not filled:
            raise InputError("DataFrames", "hold no row", "give at least one stream with rows")
        first = min(float(time_s.min()) for time_s, _, _ in filled.values())
        streams = {s: make_stream(s, time_s - first, values, quantities, rate_hz=_rate_hz(time_s))
                   for s, (time_s, values, quantities) in filled.items()}
        content = hashlib.sha256()
        for s, stream in streams.items():
            content.update(f"{s} {stream.quantities}".encode() + stream.time_s.tobytes() + stream.values.tobytes())
        return cls(name, streams, dict(metadata or {}), Provenance(name, content.hexdigest(), "pandas"), first)

    def with_streams(self, **streams: Stream) -> Flight:
        """Return a copy with some streams replaced or added.

        Parameters
        ----------
        **streams : Stream
            By name.

        Returns
        -------
        Flight
            The other streams are shared.
        """
        return replace(self, streams={**self.streams, **streams})

    def without_streams(self, *names: str) -> Flight:
        """Return a copy without some streams.

        Parameters
        ----------
        *names : str
            Names that the flight does not have are ignored.

        Returns
        -------
        Flight
            The other streams are shared.
        """
        return replace(self, streams={k: v for k, v in self.streams.items() if k not in names})

    def retimed(self, clock: str = "retimed", judged: Iterable[str] = ("position", "velocity")) -> Flight:
        """The former name of ``moving.apply.retimed``: warns, and goes with the next release."""
        today = "nanobench_tools.time_offsets.moving.apply"
        warn_renamed("Flight.retimed", f"{today}.retimed")
        moved: Flight = importlib.import_module(today).retimed(self, clock, judged)
        return moved

    def during(self, spans: Span | Iterable[Span]) -> Flight:
        """Return a copy in which every stream is cut to spans.

        Parameters
        ----------
        spans : Span or iterable of Span
            s from the first row, ends included.

        Returns
        -------
        Flight
            Times stay seconds of the whole recording.
        """
        spans = [spans] if isinstance(spans, Span) else list(spans)
        return replace(self, streams={k: v.during(spans) for k, v in self.streams.items()})


def poses_alone(flight: Flight) -> bool:
    """Whether a recording has tracked poses and no stream of the vehicle."""
    return "mocap" in flight.streams and all(name == "mocap" or kept_apart(name) for name in flight.streams)


def make_stream(name: str, time_s: ArrayLike, values: ArrayLike, quantities: Sequence[str],
                columns: Sequence[str] | None = None, **kwargs: Any) -> Stream:
    """Make a stream of the vocabulary, with its units and frame.

    Parameters
    ----------
    name : str
        Key of ``STREAM_QUANTITIES``, such as ``imu``.
    time_s : ndarray
        (n,) seconds from the first row of the recording.
    values : ndarray
        (n, k) in the units of ``STREAM_QUANTITIES[name]`` (SI).
    quantities : sequence of str
        (k) names of the values in ``STREAM_QUANTITIES[name]``.
    columns : sequence of str, optional
        (k) names of the source; default: those of the quantities.
    **kwargs
        Further fields of ``Stream``.

    Returns
    -------
    Stream
        With copies only where the arrays are no float arrays.

    Raises
    ------
    KeyError
        For an unknown name, or a quantity that the stream does not have.
    """
    known = STREAM_QUANTITIES[name]
    frame = next(iter(known.values()))[1]
    return Stream(np.asarray(time_s, float), np.asarray(values, float), tuple(columns or quantities), tuple(quantities),
                  tuple(known[q][0] for q in quantities), frame=frame, **kwargs)


def _span_of(key: slice) -> Span:
    if key.step is not None:
        raise TypeError("a flight is cut by time, flight[2.0:6.0], without a step")
    span = Span(-np.inf if key.start is None else float(key.start), np.inf if key.stop is None else float(key.stop))
    if span.end_s < span.start_s:
        raise ValueError(f"flight[{span.start_s:g}:{span.end_s:g}] ends before it starts; give the earlier time first")
    return span


def _rate_hz(time_s: np.ndarray) -> float:
    steps = np.diff(time_s)
    typical = float(np.median(steps)) if len(steps) else 0.0
    return 1.0 / typical if typical > 0.0 else float("nan")

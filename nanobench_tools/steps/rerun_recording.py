"""A flight and its audit as a recording of the Rerun viewer (https://rerun.io, rerun-sdk 0.41): one .rrd file.

Drawn is what was measured. Rows that the audit cuts, rows that a resampler interpolated between packets and rows
without a number are left out. A line breaks where something was cut and at gaps, and a vehicle vanishes while nothing
is known of it. How many rows are left out is in the log. Times are seconds from the first row, as recorded.
"""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from .. import so3
from ..auditing.audit_verdict import AuditVerdict, verdict_of
from ..auditing.faults.kinds import cutting
from ..auditing.recording_audit import Audit, audit
from ..errors import MissingExtraError
from ..flight import STREAM_QUANTITIES, Flight, Span, mask_of, merge_spans, motors_of
from ..pages.recording import LONGEST_GAP_S, colour_of
from ..results.result import to_json
from ..results.result_files import SURROGATE, to_text, write_bytes
from ..signals.context import Context
from ..signals.packet_rows import packets_of
from ..signals.usable_rows import runs, typical_step_s, usable_streams
from ..version import __version__

TIMELINE = "time"
POSITIONS = (("mocap", "mocap", ("px", "py", "pz"), 0x888888FF),
             ("onboard_estimate", "estimator", ("x", "y", "z"), 0x56B4E9FF),
             ("set_point", "setpoint", ("x", "y", "z"), 0xE69F00FF))
"""Name in the viewer, stream, quantities, colour (RGBA)."""
ATTITUDES = {"mocap": ("mocap",), "onboard_estimate": ("attitude_qw", "attitude")}
"""Whose attitude: the first stream that has one."""
QUATERNION, EULER = ("qx", "qy", "qz", "qw"), ("roll", "pitch", "yaw")
SIGNALS = (("imu/gyro", "imu", ("gyro_x", "gyro_y", "gyro_z")),
           ("imu/accelerometer", "imu", ("acc_x", "acc_y", "acc_z")),
           ("motor_command", "motor", ()), ("rotor_speed", "rpm", ()), ("battery", "battery", ("vbat",)))
"""Name in the viewer, stream, quantities; none: every motor."""
LEVELS = {"red": "ERROR", "orange": "WARN", "grey": "INFO"}
STATE_COLOURS = {"red": 0xD55E00FF, "orange": 0xE69F00FF, "grey": 0x999999FF, "sky": 0x56B4E9FF, "green": 0x009E73FF}
AXIS_COLOURS = np.array([0xE6194BFF, 0x3CB44BFF, 0x4363D8FF], np.uint32)
AXIS_M, RADIUS_M, BAR_WIDTH = 0.1, 0.015, 0.8
AFTER_S = 1e-9
"""Step of the viewer's clock, after which a row is over where none follows."""
MISSED_STEPS = 5
"""Rows of a slow stream may be so many usual steps apart before its line breaks."""
LEAST_SHARE = 0.003
"""A mark shorter than this share of the recording would not be seen."""


@dataclass(frozen=True)
class Measured:
    """Rows of one stream that are drawn: time_s (n,), values (n, k); stretches (m, 2) first and one-past-last row
    without a break."""

    time_s: np.ndarray
    values: np.ndarray
    stretches: np.ndarray

    @property
    def spans(self) -> list[Span]:
        return [Span(float(self.time_s[a]), float(self.time_s[b - 1])) for a, b in self.stretches]


def write_rrd(flight: Flight, path: Path) -> Path:
    """Writes ``path``, whole or not at all. MissingExtraError without rerun-sdk."""
    rr = rerun()
    verdict = audit(flight)
    context = Context(flight)
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "flight.rrd"
        recording = rr.RecordingStream("nanobench", recording_id=_clean(f"{flight.name} {flight.provenance.sha256}"),
                                       send_properties=False)
        recording.save(whole)
        _Writer(rr, recording, flight, context, verdict).write()
        recording.flush()
        recording.disconnect()
        write_bytes(path, whole.read_bytes())
    return path


def rerun() -> ModuleType:
    """The package ``rerun``; MissingExtraError where it is not installed."""
    try:
        import rerun
        import rerun.blueprint
    except ImportError:
        raise MissingExtraError("rerun-sdk", "viewer") from None
    module: ModuleType = rerun
    return module


def measured(context: Context, verdict: Audit, name: str, quantities: Sequence[str],
             wanted: Sequence[Span] | None = None) -> Measured | None:
    """The rows of stream ``name`` to draw, within ``wanted`` if given; None without any."""
    stream = context.once(usable_streams).get(name)
    if stream is None or not quantities or not all(q in stream for q in quantities):
        return None
    values, time_s = stream[tuple(quantities)], stream.time_s
    bad = mask_of((f.span for f in verdict.faults if f.kind in cutting() and f.stream in (name, "")), time_s)
    bad |= ~np.isfinite(values).all(axis=1)
    if wanted is not None:
        bad |= ~mask_of(wanted, time_s)
    keep = np.flatnonzero(~(bad | between_packets(context, verdict, name)))
    if not len(keep):
        return None
    t = time_s[keep]
    longest_s = max(LONGEST_GAP_S, MISSED_STEPS * typical_step_s(t)) if len(t) > 1 else LONGEST_GAP_S
    breaks = np.flatnonzero((np.diff(np.cumsum(bad)[keep]) > 0) | (np.diff(t) > longest_s)) + 1
    return Measured(t, values[keep], np.column_stack([np.r_[0, breaks], np.r_[breaks, len(t)]]))


def between_packets(context: Context, verdict: Audit, name: str) -> np.ndarray:
    """(n,) bool: the rows of a resampled stream that no packet brought."""
    packets = context.once(packets_of).get(name)
    if packets is None or not any(f.kind == "interpolated" and f.stream == name for f in verdict.faults):
        return np.zeros(len(context.once(usable_streams)[name]), dtype=bool)
    return np.asarray(packets.straight & ~packets.still)


class _Writer:
    """One flight into one stream of a recording."""

    def __init__(self, rr: ModuleType, recording: Any, flight: Flight, context: Context, audited: Audit) -> None:
        self.rr, self.to, self.flight, self.context, self.audit = rr, recording, flight, context, audited
        self.verdict: AuditVerdict = verdict_of(audited)

    def write(self) -> None:
        self.blueprint()  # before the data, or the viewer chooses the layout
        self.properties()
        self.world()
        self.signals()
        self.bars()
        self.usable()
        self.lanes()
        self.log()

    def properties(self) -> None:
        """Properties of the recording as a whole."""
        flight = self.flight
        known = {"verdict": self.verdict.sentence, "severity": self.verdict.severity, "advice": self.verdict.advice,
                 "controller": self.audit.controller, "trajectory": flight.metadata.get("family"),
                 "speed": flight.metadata.get("speed"), "file": flight.provenance.path,
                 "sha256": flight.provenance.sha256, "source": flight.provenance.source,
                 "synthetic": str(flight.provenance.synthetic).lower(), "written_by": f"nanobench {__version__}",
                 "clock": "moved by " + ", ".join(flight.provenance.clock_evidence)
                 if flight.provenance.clock_evidence else "as recorded",
                 "sheet": to_text(to_json(flight.metadata))}
        self.to.send_recording_name(_clean(("SYNTHETIC " if flight.provenance.synthetic else "") + flight.name))
        if flight.epoch_s > 0.0:
            self.to.send_recording_start_time_nanos(round(1e9 * flight.epoch_s))
        self.to.send_property("flight", self.rr.AnyValues(**{k: _clean(str(v)) for k, v in known.items() if v}))

    def world(self) -> None:
        """Paths in the world [m], and where the vehicle is: a point, with axes x, y, z where its attitude is known."""
        self.static("world", self.rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        for name, stream, quantities, colour in POSITIONS:
            asked = stream == "setpoint"
            place = measured(self.context, self.audit, stream, quantities, self.asked_for() if asked else None)
            if place is None:
                continue
            self.static(f"world/paths/{name}", self.rr.LineStrips3D(
                [place.values[a:b] for a, b in place.stretches], colors=[colour]))
            if asked:
                continue
            self.send(f"world/{name}", place.time_s, self.rr.Transform3D.columns(translation=place.values))
            self.appear(f"world/{name}", place, 1, lambda n, c=colour: self.rr.Points3D.columns(
                positions=np.zeros((n, 3)), radii=np.full(n, RADIUS_M), colors=np.full(n, c, np.uint32)))
            self.axes(name, place)

    def asked_for(self) -> list[Span] | None:
        """When the set-point is a position: in the air, and not the zeros logged without a command."""
        stream = self.context.once(usable_streams).get("setpoint")
        if stream is None or not all(q in stream for q in ("x", "y", "z")):
            return None
        there = np.any(stream["x", "y", "z"], axis=1)
        if self.audit.airborne:
            there &= mask_of(self.audit.airborne, stream.time_s)
        return [Span(float(stream.time_s[a]), float(stream.time_s[b - 1])) for a, b in runs(there)]

    def axes(self, name: str, place: Measured) -> None:
        """The body's axes, at the times of the attitude's own rows, while the place is known."""
        for stream in ATTITUDES[name]:
            quantities = EULER if stream == "attitude" else QUATERNION
            found = measured(self.context, self.audit, stream, quantities, place.spans)
            if found is None:
                continue
            turn = so3.from_euler_zyx(*found.values.T) if stream == "attitude" else found.values
            self.send(f"world/{name}/body", found.time_s, self.rr.Transform3D.columns(quaternion=turn))
            self.appear(f"world/{name}/body", found, 3, lambda n: self.rr.Arrows3D.columns(
                vectors=np.tile(AXIS_M * np.eye(3), (n // 3, 1)), colors=np.tile(AXIS_COLOURS, n // 3)))
            return

    def appear(self, path: str, where: Measured, each: int, columns: Any) -> None:
        """``columns(n)``, ``each`` at a time, from the first to the last row of each stretch; nothing between."""
        ends = where.time_s[where.stretches - [0, 1]] + [0.0, AFTER_S]
        count = np.tile([each, 0], len(ends))
        self.send(path, ends.ravel(), columns(int(count.sum())).partition(count))

    def signal(self, stream: str, quantities: Sequence[str]) -> tuple[Sequence[str], Measured | None]:
        """``quantities``, or every motor, and their rows."""
        if stream not in self.flight:
            return (), None
        names = quantities or motors_of(self.flight[stream])
        return names, measured(self.context, self.audit, stream, names)

    def signals(self) -> None:
        """Series over time, broken where nothing was measured."""
        for path, stream, quantities in SIGNALS:
            names, found = self.signal(stream, quantities)
            if found is None:
                continue
            ends = found.stretches[:-1, 1]
            time_s = np.insert(found.time_s, ends, found.time_s[ends - 1] + AFTER_S)
            self.static(path, self.rr.SeriesLines(names=[f"{name} [{unit_of(stream, name)}]" for name in names]))
            self.send(path, time_s, self.rr.Scalars.columns(scalars=np.insert(found.values, ends, np.nan, axis=0)))

    def bars(self) -> None:
        """Motor commands as bars from 0 to 1, upwards."""
        names, found = self.signal("motor", ())
        if found is None:
            return
        n, k = found.values.shape
        ends = found.stretches[:, 1]
        half = np.column_stack([np.full(n * k, BAR_WIDTH / 2), found.values.ravel() / 2])
        middle = np.column_stack([np.tile(np.arange(1.0, k + 1), n), -half[:, 1]])
        self.send("bars/command", np.insert(found.time_s, ends, found.time_s[ends - 1] + AFTER_S),
                  self.rr.Boxes2D.columns(centers=middle, half_sizes=half).partition(np.insert(np.full(n, k), ends, 0)))
        self.static("bars/names", self.rr.Points2D(np.column_stack([np.arange(1.0, k + 1), np.zeros(k)]), labels=names,
                                                   radii=0.0, show_labels=True))

    def usable(self) -> None:
        """1 where the audit calls the recording usable, 0 elsewhere."""
        whole, spans = self.audit.span, self.verdict.usable
        time_s = np.array([whole.start_s, *(t for s in spans for t in (s.start_s, s.end_s)), whole.end_s])
        values = np.array([0.0, *[1.0, 0.0] * len(spans), 0.0])
        last = np.append(np.diff(time_s) > 0.0, True)  # of equal times the last one counts
        self.static("usable", self.rr.SeriesLines(names=["usable"], interpolation_mode="StepAfter"))
        self.send("usable", time_s[last], self.rr.Scalars.columns(scalars=values[last]))

    def lanes(self) -> None:
        """Coloured spans over time: in the air, usable, and every event of the audit."""
        self.lane("in the air", self.audit.airborne, "sky")
        self.lane("usable", self.verdict.usable, "green")
        for event in self.verdict.events:
            streams = event.streams[0] if len(event.streams) == 1 else f"{len(event.streams)} streams"
            self.lane(f"{event.kind.replace('_', ' ')} {streams}".strip(), event.spans, colour_of(event.kind))

    def lane(self, name: str, spans: Sequence[Span], colour: str) -> None:
        least = LEAST_SHARE * self.audit.span.duration_s
        seen = merge_spans(Span(s.start_s, max(s.end_s, s.start_s + least)) for s in spans)
        if not seen:
            return
        path = self.rr.new_entity_path(["audit", _clean(name)])
        self.static(path, self.rr.StateConfiguration(values=["on"], labels=[_clean(name)],
                                                     colors=[STATE_COLOURS[colour]]))
        self.send(path, np.array([t for s in seen for t in (s.start_s, s.end_s)]),
                  self.rr.StateChange.columns(state=["on"] * len(seen)).partition(np.tile([1, 0], len(seen))))

    def log(self) -> None:
        """The verdict, every event where it begins, information, and what is not drawn."""
        events = self.verdict.events
        told = {(event.kind, stream) for event in events for stream in event.streams}
        start_s = self.audit.span.start_s
        rows = [(start_s, "INFO", self.verdict.sentence)]
        rows += [(start_s, "INFO", text) for text in self.left_out()]
        rows += [(span.start_s, LEVELS[colour_of(event.kind)],
                  _told(event.kind, span, "; ".join(filter(None, (event.sentence, event.advice)))))
                 for event in events for span in event.spans]
        rows += [(f.start_s, LEVELS[colour_of(f.kind)], _told(f.kind, f.span, f.evidence))
                 for f in self.audit.faults if (f.kind, f.stream) not in told]
        rows.sort(key=lambda row: row[0])
        time_s, levels, texts = zip(*rows, strict=True)
        self.send("log", np.array(time_s), self.rr.TextLog.columns(text=list(map(_clean, texts)), level=list(levels)))

    def left_out(self) -> Iterator[str]:
        """Per stream, how many rows no packet brought."""
        for name in self.context.once(usable_streams):
            if count := int(between_packets(self.context, self.audit, name).sum()):
                yield f"{name}: {count} interpolated rows between packets are not shown"

    def blueprint(self) -> None:
        """World and bars at the left; series, audit and log at the right."""
        rrb = self.rr.blueprint
        left = [rrb.Spatial3DView(origin="world", name="world [m]")]
        right = []
        for path, stream, quantities in SIGNALS:
            names, found = self.signal(stream, quantities)
            if found is not None:
                title = f"{path.replace('_', ' ').replace('/', ' ')} [{unit_of(stream, names[0])}]"
                right.append(rrb.TimeSeriesView(origin=path, name=title, plot_legend=rrb.Corner2D.RightTop))
            if found is not None and stream == "motor":
                frame = rrb.VisualBounds2D(x_range=[0.0, len(names) + 1.0], y_range=[-1.1, 0.1])
                left.append(rrb.Spatial2DView(origin="bars", name="motor command, 0 to 1", visual_bounds=frame))
        shares = [2] * len(right) + [1, 3, 3]
        right += [rrb.TimeSeriesView(origin="usable", name="usable, 0 or 1"),
                  rrb.StateTimelineView(origin="audit", name="audit"), rrb.TextLogView(origin="log", name="log")]
        # active: a default alone gives way to the viewer's own layout
        self.to.send_blueprint(rrb.Blueprint(
            rrb.Horizontal(rrb.Vertical(*left, row_shares=[3, 1][:len(left)]), rrb.Vertical(*right, row_shares=shares)),
            rrb.TimePanel(timeline=TIMELINE, state="collapsed"), collapse_panels=True),
            make_active=True, make_default=True)

    def static(self, path: str, what: Any) -> None:
        self.to.log(path, what, static=True, strict=True)

    def send(self, path: str, time_s: np.ndarray, columns: Any) -> None:
        """Rows of one entity at ``time_s`` (n,) s, all at once."""
        stamps = np.round(1e9 * np.asarray(time_s)).astype("timedelta64[ns]")
        self.to.send_columns(path, [self.rr.TimeColumn(TIMELINE, duration=stamps)], columns, strict=True)


def unit_of(stream: str, quantity: str) -> str:
    """SI unit; of motor commands in words."""
    unit = STREAM_QUANTITIES[stream][quantity][0]
    return "share of full" if unit == "1" else unit


def _told(kind: str, span: Span, words: str) -> str:
    return f"{kind.replace('_', ' ')} {span.start_s:.2f} to {span.end_s:.2f} s: {words}"


def _clean(text: str) -> str:
    """Text that every file can hold."""
    return SURROGATE.sub("\ufffd", text)

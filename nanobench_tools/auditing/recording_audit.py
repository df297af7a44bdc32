"""The audit of one recording: its errors, its usable spans, late clocks, and the controller that flew.

``audit(flight)`` runs every registered fault kind over one shared ``Context`` and collects the verdict. The entry
points are ``nanobench.faults``, with ``faults.kind``. It ignores the name.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..flight import Fault, Flight, Span, kept_apart, merge_spans, subtract_spans
from ..results.result import Result, from_json, to_json
from ..signals.airborne import airborne_spans
from ..signals.context import Context
from ..signals.controller import controller_of
from ..signals.rates import RateReading, rates_of
from ..signals.unchecked import unchecked
from ..signals.usable_rows import whole_span
from ..time_offsets.constant.reading import ClockReading
from ..time_offsets.moving.moving_readings import clocks_with_time_offset
from ..time_offsets.moving.time_offset import TimeOffset
from .faults.copy import copies, fault_of
from .faults.kinds import cutting, kinds, log_ended
from .turning_faults import settled

TIMED = ("imu", "attitude", "attitude_qw", "estimator")
"""Streams that motion capture predicts."""


@dataclass(frozen=True, repr=False)
class Audit(Result):
    """Verdict on one recording; all times in seconds from its first row.

    Attributes
    ----------
    flight, path, sha256 : str
        Name, file, and hash of its content.
    controller : str
        ``pid``, ``mellinger``, ``none`` (motors never ran) or ``unknown``.
    airborne : tuple of Span
        From first to last crossing of 5 cm above the resting height.
    clean : tuple of Span
        The recording without the cutting faults of any stream. A constant battery reading does not affect the other
        streams (``clean_for`` with the battery cuts it).
    faults : tuple of Fault
        Every fault that was found.
    clock : mapping of str to ClockReading
        By stream: offset, interval and moving error against the motion capture.
    rates : mapping of str to RateReading
        By stream: number of samples that were sent, and their rate.
    span : Span
        From the first to the last timestamp.
    lost_link : str
        How a flight ended whose link or log was lost in the air; empty for others.
    unchecked : tuple of str
        Signs, axes, scales and offsets that no other column of the recording shows.
    """

    flight: str
    path: str
    sha256: str
    controller: str
    airborne: tuple[Span, ...]
    clean: tuple[Span, ...]
    faults: tuple[Fault, ...]
    clock: dict[str, ClockReading]
    rates: dict[str, RateReading]
    span: Span
    lost_link: str = ""
    unchecked: tuple[str, ...] = ()

    def clean_for(self, streams: Iterable[str], kinds: Iterable[str] | None = None) -> tuple[Span, ...]:
        """Spans of the recording without a fault of ``kinds`` (None: of those that cut) in ``streams``; not intersected
        with airborne.

        A fault without a stream (``stream`` empty) counts for every stream; those of ``extra`` never count.
        """
        streams, kinds = {s for s in (*streams, "") if not kept_apart(s)}, cutting() if kinds is None else set(kinds)
        return subtract_spans([self.span], [f.span for f in self.faults if f.kind in kinds and f.stream in streams])

    def retimed(self, time_offset: TimeOffset | None) -> Audit:
        """The verdict on the flight with ``time_offset`` taken out: spans of faults in moved streams grow by what
        the timestamps moved."""
        if time_offset is None:
            return self
        lateness = np.append(time_offset.offset_s, time_offset.constant_s)
        early, late = float(lateness.max()), float(lateness.min())
        faults = tuple(f if f.stream == "mocap" else replace(f, start_s=f.start_s - early, end_s=f.end_s - late)
                       for f in self.faults)
        # the end of a log still reaches the end of the recording, wherever its timestamps went
        faults = tuple(replace(f, end_s=max(f.end_s, self.span.end_s)) if f.kind in log_ended() else f
                       for f in faults)
        cuts = merge_spans(f.span for f in faults if _cuts_every_use(f))
        return replace(self, faults=faults, clean=subtract_spans([self.span], cuts))

    def to_json(self) -> dict[str, Any]:
        """The flight's entry of ``nanobench audit --json``; numbers that do not exist are None."""
        return {
            "flight": self.flight,
            "path": self.path,
            "sha256": self.sha256,
            "controller": self.controller,
            "span": [self.span.start_s, self.span.end_s],
            "airborne": [[s.start_s, s.end_s] for s in self.airborne],
            "clean": [[s.start_s, s.end_s] for s in self.clean],
            "faults": [{
                           "kind": f.kind,
                           "stream": f.stream,
                           "columns": list(f.columns),
                           "start_s": f.start_s,
                           "end_s": f.end_s,
                           "size": _number(f.size),
                           "unit": f.unit,
                           "evidence": f.evidence,
                           "minimum_detectable": _number(f.minimum_detectable),
                       }
                       for f in self.faults],
            "clock": _shared(to_json(self.clock)),
            "rates": {name: {"samples": r.samples, "rate_hz": _number(r.rate_hz)} for name, r in self.rates.items()},
            "unchecked": list(self.unchecked),
        } | ({"lost_link": self.lost_link} if self.lost_link else {})

    @classmethod
    def from_json(cls, body: Mapping[str, Any]) -> Audit:
        """The inverse of ``to_json``."""
        return cls(
            flight=body["flight"],
            path=body["path"],
            sha256=body["sha256"],
            controller=body["controller"],
            airborne=tuple(Span(*s) for s in body["airborne"]),
            clean=tuple(Span(*s) for s in body["clean"]),
            faults=tuple(
                Fault(f["kind"], f["stream"], tuple(f["columns"]), f["start_s"], f["end_s"], _nan(f["size"]), f["unit"],
                      f["evidence"], _nan(f.get("minimum_detectable")))
                for f in body["faults"]
            ),
            clock=from_json(dict[str, ClockReading], _unshared(body["clock"])),
            rates={name: RateReading(r["samples"], _nan(r["rate_hz"])) for name, r in body["rates"].items()},
            span=Span(*body["span"]),
            lost_link=body.get("lost_link", ""),
            unchecked=tuple(body.get("unchecked", ())),
        )


def _shared(clock: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Write a time error shared by several streams once, with the first; the others name it (``warp_of``)."""
    first: dict[str, str] = {}
    found = {}
    for stream, reading in clock.items():
        owner = first.setdefault(repr(reading["warp"]), stream) if reading["warp"] else stream
        found[stream] = reading if owner == stream else {**reading, "warp": [], "warp_of": owner}
    return found


def _unshared(clock: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """The inverse of ``_shared``."""
    return {stream: {key: value for key, value in reading.items() if key != "warp_of"}
            | ({"warp": clock[reading["warp_of"]]["warp"]} if "warp_of" in reading else {})
            for stream, reading in clock.items()}


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _nan(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _cuts_every_use(fault: Fault) -> bool:
    kind = kinds().get(fault.kind)
    return kind is not None and kind.cuts and not kept_apart(fault.stream) and fault.stream not in kind.spares


def audit(flight: Flight, context: Context | None = None) -> Audit:
    """Audit of one recording from its content. Pure; about 0.6 s for 42 s of flight.

    context: of ``flight``, to reuse its derived signals. A gyro or attitude that is wrong is mended for the other
    checks.
    """
    context = Context(flight) if context is None else context
    span = context.once(whole_span)
    faults, context = settled(context)
    for kind in kinds().values():
        faults.extend(kind.find(context.flight, context))
    faults.sort(key=lambda f: (f.start_s, f.kind, f.stream, f.end_s))
    cuts = merge_spans(f.span for f in faults if _cuts_every_use(f))
    clock = clocks_with_time_offset(context)
    return Audit(flight=flight.name, path=flight.provenance.path, sha256=flight.provenance.sha256,
                 controller=controller_of(context), airborne=context.once(airborne_spans),
                 clean=subtract_spans([span], cuts), faults=tuple(faults), clock=clock,
                 rates=context.once(rates_of), span=span, lost_link=lost_link_of(flight.metadata),
                 unchecked=(*context.once(unchecked), *_open_clocks(flight, clock)))


def _open_clocks(flight: Flight, clock: Mapping[str, ClockReading]) -> list[str]:
    """Streams that motion capture predicts, and whose clock it does not show."""
    left = [name for name in TIMED if name in clock and not clock[name].identifiable]
    return [f"clock of {', '.join(left)}"] if left and "mocap" in flight else []


def lost_link_of(sheet: Mapping[str, Any]) -> str:
    """How a flight ended whose link or log was lost in the air; "" for others. ``fly`` and ``record`` find it in the
    later poses, and keep it as ``recorder.lost_link`` in the sheet."""
    found = sheet.get("recorder")
    found = found.get("lost_link") if isinstance(found, Mapping) else None
    if not isinstance(found, Mapping) or "how" not in found:
        return ""
    where = f"the link or its log was lost {_metres(found.get('height_m'))} above the ground"
    if found["how"] not in ("landed", "fell"):
        return f"{where}, and its end is unknown ({found.get('why', 'no poses')})"
    sank = found.get("sank_m_s")
    speed = f" with {sank:.1f} m/s" + (" at most" if found["how"] == "landed" else "") \
        if isinstance(sank, int | float) else ""
    return f"{where}, and the vehicle {found['how']}{speed}"


def _metres(value: Any) -> str:
    return f"{value:.2f} m" if isinstance(value, int | float) else "an unknown height"


def find_copies(flights: Sequence[Flight]) -> list[list[str]]:
    """Groups of two or more flights with the same numbers, by name, in the order given (see ``faults.copy``)."""
    return [[flights[i].name for i in group] for group in copies(flights)]


def with_copies(audits: Sequence[Audit], flights: Sequence[Flight]) -> list[Audit]:
    """The verdicts, with a ``copy`` fault on every flight whose numbers an earlier one has; both in the same order."""
    marked = list(audits)
    for first, *others in copies(flights):
        for i in others:
            marked[i] = replace(marked[i], faults=(*marked[i].faults, fault_of(flights[i], flights[first].name)))
    return marked

"""Streams of one recording without a common time: no value of one can be compared with a value of another."""

from dataclasses import dataclass

import numpy as np

from ..flight import Flight, Span

JUDGES = ("mocap", "imu", "estimator", "attitude_qw", "attitude", "motor", "rpm")
"""Streams of a vehicle in flight, the one first with which the others are compared."""
ASIDE = ("stand", "extra")
"""Their rows are not compared with others in time."""


@dataclass(frozen=True)
class Apart:
    """``stream`` and ``other`` have no common time; ``gap_s`` lies between them, their own times are spans of seconds
    since ``Flight.epoch_s``."""

    stream: str
    other: str
    span: Span
    other_span: Span

    @property
    def gap_s(self) -> float:
        return max(self.span.start_s - self.other_span.end_s, self.other_span.start_s - self.span.end_s)

    @property
    def clocks_differ(self) -> bool:
        """Whether the time between them is longer than both: they count from different moments."""
        return self.gap_s > max(self.span.duration_s, self.other_span.duration_s)


def apart(flight: Flight) -> list[Apart]:
    """Every stream without time in common with the first of JUDGES that the flight has."""
    spans = {name: span for name, stream in flight.streams.items() if not name.startswith(ASIDE)
             if (span := _span(stream.time_s)) is not None}
    judge = next((name for name in JUDGES if name in spans), None)
    if judge is None:
        return []
    first = spans[judge]
    return [Apart(name, judge, span, first) for name, span in spans.items()
            if span.start_s > first.end_s or span.end_s < first.start_s]


def _span(time_s: np.ndarray) -> Span | None:
    finite = time_s[np.isfinite(time_s)]
    return Span(float(finite.min()), float(finite.max())) if len(finite) else None


def told(found: Apart, epoch_s: float) -> str:
    """In words, with the times as the file has them."""
    def at(span: Span) -> str:
        return f"{span.start_s + epoch_s:.1f} to {span.end_s + epoch_s:.1f} s"

    return (f"{found.stream} ({at(found.span)}) and {found.other} ({at(found.other_span)}) do not overlap in time"
            + (": their clocks differ (such as time since boot and Unix time)" if found.clocks_differ else ""))

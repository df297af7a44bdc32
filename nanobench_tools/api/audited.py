"""``nb.audit``: finds what is wrong with a recording, and where it may be used."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

from ..auditing.audit_verdict import AuditVerdict, verdict_of
from ..auditing.flight_health import Health, health_of
from ..auditing.recording_audit import Audit
from ..auditing.verb_needs import can
from ..flight import Flight, Span
from .loading import place_of, short_table
from .quiet_options import given, in_python, some, speaks_python

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class FlightAudit:
    """The audit of one flight.

    Attributes
    ----------
    flight : Flight
        The flight.
    detail : Audit
        Everything: faults, clocks, rates, clean spans; as in audit.json.
    judged : AuditVerdict
        Events and usable spans.
    """

    flight: Flight
    detail: Audit
    judged: AuditVerdict

    @property
    def verdict(self) -> str:
        """One sentence: how much is usable, and what is wrong."""
        return self.judged.sentence

    @property
    def severity(self) -> str:
        """``fine`` | ``minor`` | ``cut`` | ``unusable``."""
        return self.judged.severity

    @property
    def advice(self) -> str:
        """What to do; empty where nothing is to be done."""
        return in_python(self.judged.advice)

    @property
    def usable(self) -> tuple[Span, ...]:
        """Spans of the flight without the parts that are cut, s from the first row."""
        return self.judged.usable

    @property
    def can(self) -> dict[str, str]:
        """By function: what this recording lacks for it; empty where it suffices."""
        return can(self.flight, self.detail)

    @property
    def health(self) -> Health:
        """Vibration, clipping and battery of the flight in the air."""
        return health_of(self.flight, self.detail)

    @property
    def faults(self) -> pd.DataFrame:
        """One row per event.

        Columns: kind, streams, from_s and to_s (s from the first row), what, advice, faults (how many were merged),
        cut_s
        (seconds cut).
        """
        import pandas as pd

        rows = [(e.kind, " ".join(e.streams), e.spans[0].start_s, e.spans[-1].end_s, e.sentence,
                 in_python(e.advice), e.faults, e.seconds_cut) for e in self.judged.events]
        return pd.DataFrame(rows, columns=["kind", "streams", "from_s", "to_s", "what", "advice", "faults", "cut_s"])

    def plot(self) -> Any:
        """A plotly figure: height and speed over time, events shaded, the usable spans below."""
        from .figures_of_results import audit_figure

        return audit_figure(self.flight, self.judged)

    def __repr__(self) -> str:
        return f"{self.flight.name}: {self.severity}. {self.verdict}" + (f" ({self.advice})" if self.advice else "")

    def _repr_html_(self) -> str:
        from markupsafe import escape

        return f"<p>{escape(repr(self))}</p>{self.faults.to_html(index=False)}"


class FlightAudits(Sequence[FlightAudit]):
    """Audits in the order of their flights; ``audits["name"]`` is that of one flight.

    Attributes
    ----------
    copies : list of list of str
        Groups of names of equal recordings.
    """

    def __init__(self, audits: Iterable[FlightAudit], copies: Sequence[Sequence[str]] = ()) -> None:
        self._audits = list(audits)
        self.copies = [list(group) for group in copies]

    @overload
    def __getitem__(self, key: int | str) -> FlightAudit: ...
    @overload
    def __getitem__(self, key: slice) -> FlightAudits: ...
    def __getitem__(self, key: int | str | slice) -> FlightAudit | FlightAudits:
        if isinstance(key, slice):
            return FlightAudits(self._audits[key], self.copies)
        return self._audits[key if isinstance(key, int) else place_of(key, [a.flight.name for a in self._audits])]

    def __len__(self) -> int:
        return len(self._audits)

    @property
    def table(self) -> pd.DataFrame:
        """One row per flight: severity, usable and flown seconds, verdict, advice."""
        import pandas as pd

        return pd.DataFrame([(a.severity, round(a.judged.usable_s, 1), round(a.judged.flight_s, 1), a.verdict, a.advice)
                             for a in self._audits],
                            index=pd.Index([a.flight.name for a in self._audits], name="flight"),
                            columns=["severity", "usable_s", "flight_s", "verdict", "advice"])

    def __repr__(self) -> str:
        return short_table(self.table)

    def _repr_html_(self) -> str:
        found: str = self.table.to_html(max_rows=50)
        return found


@overload
def audit(flights: Flight) -> FlightAudit: ...
@overload
def audit(flights: Iterable[Flight]) -> FlightAudits: ...
@speaks_python
def audit(flights: Flight | Iterable[Flight]) -> FlightAudit | FlightAudits:
    """Find the faults of one or several flights, their clean spans, late clocks and copies.

    Parameters
    ----------
    flights : Flight or iterable of Flight
        As ``nb.load`` gives them.

    Returns
    -------
    FlightAudit or FlightAudits
        For one flight or for several.

    Raises
    ------
    NanobenchError
        Where a flight cannot be audited; the message names it.

    Examples
    --------
    >>> import nanobench_tools as nb
    >>> found = nb.audit(nb.simulate(2, seed=1, seconds=12.0)[0])
    >>> found.severity in ("fine", "minor"), found.can["estimate"]
    (True, '')
    """
    read = some(flights)
    options = given(read)
    audits, copies = options.audit(read)
    if options.failed:
        from ..errors import NanobenchError

        raise NanobenchError(options.failed[0]["error"])
    found = [FlightAudit(f, audits[f.name], verdict_of(audits[f.name])) for f in read]
    return found[0] if isinstance(flights, Flight) else FlightAudits(found, copies)

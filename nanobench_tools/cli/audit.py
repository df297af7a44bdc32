"""``nanobench audit``: what is wrong with recordings, and where they may be used."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

from ..steps.options import Options, one_line
from .closing import close, same
from .shared_options import shared_options

if TYPE_CHECKING:
    from rich.table import Table

    from ..auditing.audit_verdict import AuditVerdict
    from ..auditing.recording_audit import Audit
    from ..flight import Fault, Flight

EVENTS_UP_TO = 3
"""With at most this many recordings every event of each is shown without being asked for."""
STYLES = {"fine": "green", "minor": "green", "cut": "yellow", "unusable": "red"}
NEXT = {"estimate": "where was it, by every estimator", "control": "how well was it flown",
        "thrust": "thrust from PWM and voltage", "motors": "motor lag and speed"}
"""Verb -> what it answers: the first one that the recordings suffice for is the next command."""


@click.command()
@shared_options("seed", "clock")
@click.option("--verbose/--no-verbose", default=False,
              help="Also the numbers of each recording and every single fault, with its evidence.")
def audit(options: Options, verbose: bool) -> int:
    """Find the faults of recordings, the spans that are clean, whose clock is late, and copies.

    One line per recording: how much of the flight is usable, what is wrong in words, what to do. Severity is fine,
    minor (corrected, or next to nothing is cut), cut, or unusable. --json and --out DIR (audit.json) hold everything.
    """
    flights = options.load()
    audits, copies = options.audit(flights)
    body = audit_body(flights, audits, copies)
    show_audits(options, audits, copies, verbose)
    for line in assumed(flights):
        options.show(line)
    _close(options, body["flights"])
    return options.finish("audit", body)


def assumed(flights: Sequence[Flight]) -> list[str]:
    """Units that nothing shows, each set of them once, in a line."""
    lines: dict[str, int] = {}
    for flight in flights:
        units: dict[str, list[str]] = {}
        for a in flight.provenance.assumptions:
            units.setdefault(a.unit, []).append(a.column)
        if units:
            told = "; ".join(f"{', '.join(columns)} in {unit}" for unit, columns in units.items())
            lines[told] = lines.get(told, 0) + 1
    return [one_line(f"assumed, not shown by name or numbers: {told}" + (f" ({n} recordings)" if n > 1 else ""))
            for told, n in lines.items()]


def audit_body(flights: Sequence[Flight], audits: Mapping[str, Audit], copies: Sequence[Sequence[str]]
               ) -> dict[str, Any]:
    """The keys of audit.json."""
    from ..auditing.audit_verdict import entry_of

    return {"flights": [entry_of(flight, audits[flight.name]) for flight in flights if flight.name in audits],
            "copies": [list(group) for group in copies]}


def show_audits(options: Options, audits: Mapping[str, Audit], copies: Sequence[Sequence[str]], verbose: bool) -> None:
    """The verdicts on stdout; of few recordings every event; ``verbose``: numbers and faults, too."""
    from ..auditing.audit_verdict import verdict_of

    label = "SYNTHETIC " if options.synthetic else ""
    verdicts = [verdict_of(a) for a in audits.values()]
    options.show(verdict_table(verdicts, f"{label}Audit of {len(audits)} recording{'s' * (len(audits) != 1)}"))
    for verdict in verdicts if len(verdicts) <= EVENTS_UP_TO else ():
        if len(verdict.events) > 1:
            options.show(event_table(verdict))
    if verbose:
        options.show(numbers_table(audits, f"{label}Numbers"))
        for a in (a for a in audits.values() if a.faults):
            options.show(fault_table(a, f"{label}{one_line(a.flight)}"))
    if copies:
        options.show("Copies (same numbers): " + "; ".join(" = ".join(map(one_line, group)) for group in copies))


def verdict_table(verdicts: Sequence[AuditVerdict], title: str) -> Table:
    """One line per recording: severity, verdict, what to do."""
    advised = any(v.advice for v in verdicts)
    heads = ("recording", "", "verdict", "what to do")[:None if advised else -1]
    table = _table(title, dict.fromkeys(heads, "left"))
    for v in verdicts:
        table.add_row(one_line(v.flight), f"[{STYLES[v.severity]}]{v.severity}[/]", one_line(v.sentence),
                      *[one_line(v.advice)] * advised)
    return table


def event_table(verdict: AuditVerdict) -> Table:
    """Every event of one recording, merged over its streams."""
    table = _table(one_line(verdict.flight), {"from s": "right", "to s": "right", "what": "left", "what to do": "left"})
    for e in verdict.events:
        table.add_row(f"{e.spans[0].start_s:.2f}", f"{e.spans[-1].end_s:.2f}", one_line(e.sentence), one_line(e.advice))
    return table


def _close(options: Options, entries: Sequence[Mapping[str, Any]]) -> None:
    """The result in a line, and the next command."""
    worth = Counter(entry["severity"] for entry in entries)
    counts = ", ".join(f"{worth[severity]} {severity}" for severity in STYLES if worth[severity])
    verb = next((v for v in NEXT if any(not entry["can"][v] for entry in entries)), "")
    if verb:
        close(options, counts, NEXT[verb], "nanobench", verb, *same(options))
    else:
        lacks = Counter(lack for entry in entries for lack in entry["can"].values()).most_common(1)
        close(options, f"{counts}; no task can use these recordings" + (f": {lacks[0][0]}" if lacks else ""))


def numbers_table(audits: Mapping[str, Audit], title: str) -> Table:
    """One line per recording; the kinds that cut time away stand in bold."""
    from ..auditing.faults.kinds import cutting, those
    from ..flight import intersect_spans

    table = _table(title, {"recording": "left", "controller": "left", "airborne s": "right", "clean s": "right",
                           "imu late ms": "right", "imu Hz": "right", "faults": "left"})
    cuts, not_shown = cutting(), those(lambda kind: not kind.in_overview)
    for a in audits.values():
        airborne = sum(s.duration_s for s in a.airborne)
        clean = sum(s.duration_s for s in intersect_spans(a.airborne, a.clean))
        clock, rate = a.clock.get("imu"), a.rates.get("imu")
        kinds = Counter(f.kind for f in a.faults if f.kind not in not_shown)
        words = ", ".join(f"[bold]{text}[/]" if kind in cuts else text for kind, n in kinds.items()
                          for text in [kind + (f" x{n}" if n > 1 else "")])
        table.add_row(one_line(a.flight), one_line(a.controller), f"{airborne:.1f}", f"{clean:.1f}", _late(clock),
                      f"{rate.rate_hz:.1f}" if rate else "-", words or "none")
    return table


def _late(clock: Any) -> str:
    if clock is None:
        return "-"
    if not clock.identifiable or clock.ci95_s is None:
        return "not identifiable"
    low, high = (1e3 * edge for edge in clock.ci95_s)
    return f"{1e3 * clock.offset_s:+.1f} \\[{low:+.1f}, {high:+.1f}]"


def fault_table(audit: Audit, title: str) -> Table:
    """Every fault of one recording, in the order of time."""
    table = _table(title, {"kind": "left", "stream": "left", "from s": "right", "to s": "right", "size": "right",
                           "evidence": "left"})
    for fault in audit.faults:
        table.add_row(fault.kind, one_line(fault.stream), f"{fault.start_s:.2f}", f"{fault.end_s:.2f}", _size(fault),
                      one_line(fault.evidence))
    return table


def _size(fault: Fault) -> str:
    return f"{fault.size:.4g} {fault.unit}" if fault.size == fault.size else ""


def _table(title: str, columns: Mapping[str, Any]) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for name, justify in columns.items():
        table.add_column(name, justify=justify, overflow="fold")
    return table

"""``nanobench audit``: finds what is wrong with recordings, and where they may be used."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

from ..steps.options import Options, one_line
from ..tables.result_table import Table
from .closing import again, close, same
from .shared_options import shared_options

if TYPE_CHECKING:
    from ..auditing.audit_verdict import AuditVerdict
    from ..auditing.recording_audit import Audit
    from ..flight import Fault, Flight

EVENTS_UP_TO = 3
"""With at most this many recordings every event of each is shown without being asked for."""
SEVERITIES = ("fine", "minor", "cut", "unusable")
NEXT = {"estimate": "where was it, by every estimator", "control": "how well was it flown",
        "thrust": "thrust from PWM and voltage", "motors": "motor lag and speed"}
"""Verb -> what it answers: the first one that the recordings suffice for is the next command."""


@click.command()
@shared_options("seed", "clock")
def audit(options: Options) -> int:
    """Find the faults of recordings, the spans that are clean, whose clock is late, and copies.

    One line per recording: how much of the flight is usable, what is wrong in words, what to do. Severity is fine,
    minor (corrected, or next to nothing is cut), cut, or unusable. Option --verbose lists every recording with its
    numbers, every fault with its evidence, vibration and battery. The files of --json and --out DIR (audit.json) hold
    everything.
    """
    flights = options.load()
    audits, copies = options.audit(flights)
    body = audit_body(flights, audits, copies)
    verb = next((v for v in NEXT if any(not entry["can"][v] for entry in body["flights"])), "")
    command = ("nanobench", verb, *same(options)) if verb else () if options.verbose else again("--verbose")
    uses = [line for entry in body["flights"] for line in (uses_of(entry), open_of(entry)) if line]
    close(options, audit_sentence(body), NEXT.get(verb, "every fault with its evidence"), *command,
          screen=[*audit_screen(options, audits, copies), *(uses if len(body["flights"]) == 1 else ()),
                  *assumed(flights)], first=True,
          detail=[*audit_detail(options, audits, copies), dataset_table(body), *health_lines(body),
                  *uses, *assumed(flights)])
    return options.finish("audit", body)


def uses_of(entry: Mapping[str, Any]) -> str:
    """The verbs that a recording suffices for, and what it lacks for the others, in one line."""
    lacks: dict[str, list[str]] = {}
    for verb, lack in entry["can"].items():
        lacks.setdefault(lack, []).append(verb)
    good = lacks.pop("", [])
    others = "; ".join(f"{', '.join(verbs)}: {lack}" for lack, verbs in lacks.items())
    return one_line(f"{entry['flight']} suffices for {', '.join(good) or 'no verb'}" + (f". Not for {others}" if others
                                                                                        else ""))


def dataset_table(body: Mapping[str, Any]) -> Table:
    """The recordings as a row of a table of data sets, line by line."""
    from ..auditing.dataset_facts import rows_of

    return Table.plain("Data set", ("of the recordings", "value"), rows_of(body["dataset"]))


def health_lines(body: Mapping[str, Any]) -> list[str]:
    """Vibration and battery of each recording, in a line."""
    from ..auditing.flight_health import sentence_of

    return [one_line(f"{entry['flight']}: {line}") for entry in body["flights"]
            if (line := sentence_of(entry["health"]))]


def open_of(entry: Mapping[str, Any]) -> str:
    """Signs, axes, scales and offsets that no other column shows, in one line; "" where everything is checked."""
    left = entry["unchecked"]
    return one_line(f"{entry['flight']} cannot be checked for {'; '.join(left)}") if left else ""


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
    from ..auditing.dataset_facts import facts_of
    from ..results.result import to_json

    return {"flights": [entry_of(flight, audits[flight.name]) for flight in flights if flight.name in audits],
            "copies": [list(group) for group in copies], "dataset": to_json(facts_of(flights, audits, copies))}


def audit_sentence(body: Mapping[str, Any]) -> str:
    """How many recordings are how good; of recordings that nothing can use, what they lack."""
    worth = Counter(entry["severity"] for entry in body["flights"])
    counts = ", ".join(f"{worth[severity]} {severity}" for severity in SEVERITIES if worth[severity])
    if any(not lack for entry in body["flights"] for verb, lack in entry["can"].items() if verb in NEXT):
        return counts
    lacks = Counter(lack for entry in body["flights"] for lack in entry["can"].values()).most_common(1)
    return f"{counts}; no task can use these recordings" + (f": {lacks[0][0]}" if lacks else "")


def audit_screen(options: Options, audits: Mapping[str, Audit], copies: Sequence[Sequence[str]]) -> list[Table | str]:
    """The verdicts, the worst first, and of few recordings every event."""
    from ..auditing.audit_verdict import verdict_of

    verdicts = sorted((verdict_of(a) for a in audits.values()), key=lambda v: -SEVERITIES.index(v.severity))
    return [verdict_table(verdicts, f"{_label(options)}Audit of {len(audits)} recording{'s' * (len(audits) != 1)}"),
            *(event_table(v) for v in verdicts if len(verdicts) <= EVENTS_UP_TO and len(v.events) > 1),
            _copies(copies)]


def audit_detail(options: Options, audits: Mapping[str, Audit], copies: Sequence[Sequence[str]]) -> list[Table | str]:
    """The same, with the numbers of each recording and every fault."""
    faulty = [a for a in audits.values() if a.faults]
    *verdicts, same_numbers = audit_screen(options, audits, copies)
    return [*verdicts, numbers_table(audits, f"{_label(options)}Numbers"),
            *(fault_table(a, f"{_label(options)}{one_line(a.flight)}") for a in faulty), same_numbers]


def _label(options: Options) -> str:
    return "SYNTHETIC " if options.synthetic else ""


def _copies(copies: Sequence[Sequence[str]]) -> str:
    return "Copies (same numbers): " + "; ".join(" = ".join(map(one_line, g)) for g in copies) if copies else ""


def verdict_table(verdicts: Sequence[AuditVerdict], title: str) -> Table:
    """One line per recording: severity and verdict; below, what to do about how many of them."""
    advised = Counter(v.advice for v in verdicts if v.advice)
    advice = "; ".join(f"{text} ({n} of {len(verdicts)})" for text, n in advised.most_common())
    return Table.plain(title, ("recording", "", "verdict"), [(v.flight, v.severity, v.sentence) for v in verdicts],
                       f"What to do: {advice}." if advice else "")


def event_table(verdict: AuditVerdict) -> Table:
    """Every event of one recording, merged over its streams."""
    return Table.plain(verdict.flight, ("from s", "to s", "what", "what to do"), [
        (f"{e.spans[0].start_s:.2f}", f"{e.spans[-1].end_s:.2f}", e.sentence, e.advice) for e in verdict.events])


def numbers_table(audits: Mapping[str, Audit], title: str) -> Table:
    """One line per recording: seconds, clock, rate, and kinds of faults."""
    from ..auditing.faults.kinds import cutting, those
    from ..flight import intersect_spans

    cuts, not_shown = cutting(), those(lambda kind: not kind.in_overview)
    rows = []
    for a in audits.values():
        airborne = sum(s.duration_s for s in a.airborne)
        clean = sum(s.duration_s for s in intersect_spans(a.airborne, a.clean))
        clock, rate = a.clock.get("imu"), a.rates.get("imu")
        kinds = Counter(f.kind for f in a.faults if f.kind not in not_shown)
        words = ", ".join(kind + (f" x{n}" if n > 1 else "") + " (cut)" * (kind in cuts) for kind, n in kinds.items())
        rows.append((a.flight, a.controller, f"{airborne:.1f}", f"{clean:.1f}", _late(clock),
                     f"{rate.rate_hz:.1f}" if rate else "-", words or "none"))
    return Table.plain(title, ("recording", "controller", "airborne s", "clean s", "imu late ms", "imu Hz", "faults"),
                       rows)


def _late(clock: Any) -> str:
    if clock is None:
        return "-"
    if not clock.identifiable or clock.ci95_s is None:
        return "not identifiable"
    low, high = (1e3 * edge for edge in clock.ci95_s)
    return f"{1e3 * clock.offset_s:+.1f} [{low:+.1f}, {high:+.1f}]"


def fault_table(audit: Audit, title: str) -> Table:
    """Every fault of one recording, in the order of time."""
    return Table.plain(title, ("kind", "stream", "from s", "to s", "size", "evidence"), [
        (f.kind, f.stream, f"{f.start_s:.2f}", f"{f.end_s:.2f}", _size(f), f.evidence) for f in audit.faults])


def _size(fault: Fault) -> str:
    return f"{fault.size:.4g} {fault.unit}" if fault.size == fault.size else ""

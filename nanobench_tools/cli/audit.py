"""``nanobench audit``: what is wrong with recordings, and where they may be used."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

from .options import Options, one_line, shared_options

if TYPE_CHECKING:
    from rich.table import Table

    from ..audit import Audit
    from ..flight import Fault

DETAILS_UP_TO = 3
"""With at most this many recordings every fault is shown without being asked for."""


@click.command()
@shared_options("seed", "clock")
@click.option("--details/--no-details", default=None,
              help=f"A table of faults per recording. Default: when there are at most {DETAILS_UP_TO}.")
def audit(options: Options, details: bool | None) -> int:
    """Find the faults of recordings, the spans that are clean, whose clock is late, and copies.

    Shows one line per recording; --json and --out DIR (audit.json) hold everything.
    """
    flights = options.load()
    audits, copies = options.audit(flights)
    show_audits(options, audits, copies, len(flights) <= DETAILS_UP_TO if details is None else details)
    return options.finish("audit", audit_body(audits, copies))


def audit_body(audits: Mapping[str, Audit], copies: Sequence[Sequence[str]]) -> dict[str, Any]:
    """The keys of audit.json."""
    return {"flights": [a.to_json() for a in audits.values()], "copies": [list(group) for group in copies]}


def show_audits(options: Options, audits: Mapping[str, Audit], copies: Sequence[Sequence[str]], details: bool) -> None:
    """The tables on stdout."""
    label = "SYNTHETIC " if options.synthetic else ""
    options.show(overview(audits, f"{label}Audit of {len(audits)} recording{'s' * (len(audits) != 1)}"))
    if details:
        for verdict in audits.values():
            options.show(fault_table(verdict, f"{label}{one_line(verdict.flight)}"))
    if copies:
        options.show("Copies (same numbers): " + "; ".join(" = ".join(map(one_line, group)) for group in copies))


def overview(audits: Mapping[str, Audit], title: str) -> Table:
    """One line per recording; the kinds that cut time away stand in bold."""
    from rich import box
    from rich.table import Table

    from ..faults.kinds import cutting, those
    from ..flight import intersect_spans

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("recording", "controller", "airborne s", "clean s", "imu late ms", "imu Hz", "faults"):
        table.add_column(name, justify="left" if name in ("recording", "controller", "faults") else "right",
                         overflow="fold")
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


def fault_table(verdict: Audit, title: str) -> Table:
    """Every fault of one recording, in the order of time."""
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("kind", "stream", "from s", "to s", "size", "evidence"):
        table.add_column(name, justify="right" if name in ("from s", "to s", "size") else "left")
    for fault in verdict.faults:
        span = (f"{fault.start_s:.2f}", f"{fault.end_s:.2f}")
        table.add_row(fault.kind, one_line(fault.stream), *span, _size(fault), one_line(fault.evidence))
    return table


def _size(fault: Fault) -> str:
    return f"{fault.size:.4g} {fault.unit}" if fault.size == fault.size else ""

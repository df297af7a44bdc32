"""``nanobench control``: scores of controllers (Task 2); here those that flew, on their logged flights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError, UsageError
from .options import Options, one_line, shared_options
from .show import ALL_FAILED, data_word, score_table, show_left_out

if TYPE_CHECKING:
    from ..audit import Audit
    from ..flight import Flight

PLANTS = ("real",)
COLUMNS = (("rmse_m", "RMSE m", 1.0, 4), ("ade_m", "ADE m", 1.0, 4), ("velocity_rmse_m_s", "velocity m/s", 1.0, 4),
           ("heading_deg", "heading deg", 1.0, 3), ("divergence_percent", "> 0.5 m %", 1.0, 3),
           ("rmse_lag_removed_m", "lag removed m", 1.0, 4))


@click.command()
@shared_options()
@click.option("--plant", default="real", show_default=True, metavar="NAME", help="real: the logged flights.")
@click.option("--protocol", "protocols", multiple=True, metavar="NAME",
              help="as-published or clean; may repeat. Default: both.")
@click.option("--controller", "controllers", multiple=True, metavar="NAME",
              help="pid, mellinger or the name of one of your own that flew; may repeat. Default: all.")
def control(options: Options, plant: str, protocols: tuple[str, ...], controllers: tuple[str, ...]) -> int:
    """Task 2: how well was it flown? Scores of the controllers that flew the recordings.

    as-published is the published pair of rows with its faults, clean the phase in which a path was streamed, by
    family, speed and controller.
    """
    from ..protocols import task2

    if plant not in PLANTS:
        raise UsageError(f"unknown plant {plant!r}; known: {', '.join(PLANTS)}")
    for name in protocols:
        task2.check_protocol(name)
    flights = options.load()
    audits, _ = options.audit(flights)
    flew = sorted({audit.controller for audit in audits.values()} - set(task2.UNNAMED))
    for name in controllers:
        if name not in flew:
            raise UsageError(f"unknown controller {name!r}; known in these recordings: {', '.join(flew) or 'none'}")
    if options.clock != "as-recorded":
        if set(protocols) - {"clean"}:
            raise UsageError(f"--clock {options.clock} goes with --protocol clean only: the published rows were made "
                             "as recorded")
        protocols = ("clean",)
    flights, audits = options.on_clock(flights, audits)
    return options.finish("control", control_body(options, flights, audits, protocols, controllers))


def control_body(options: Options, flights: Sequence[Flight], audits: Mapping[str, Audit],
                 protocols: Sequence[str] = (), controllers: Sequence[str] = ()) -> dict[str, Any]:
    """The keys of control.json, with the tables shown. Without ``protocols`` all that the data allow.

    Raises InputError when a protocol that was asked for (or every one) finds nothing to score.
    """
    from ..harness import make_item
    from ..protocols import task2

    rows: list[dict[str, Any]] = []
    reasons: dict[str, str] = {}

    def select(protocol: str) -> list[task2.Case]:
        found = task2.select(flights, audits, protocol)
        cases = [case for case in found if not controllers or case.controller in controllers]
        reasons.update({case.flight.name: f"flown by {case.controller}, not asked for" for case in found
                        if controllers and case.controller not in controllers})
        if not cases:
            raise InputError(found[0].flight.provenance.path, f"protocol {protocol!r} has no flight of "
                             f"{' or '.join(controllers)} among {len(flights)} recordings")
        return cases

    for protocol, cases in options.selected(protocols, task2.PROTOCOLS, select):
        items = [make_item(task2.score, {"case": case}, f"{protocol} {case.controller} {case.flight.name}",
                           file=case.flight.provenance.path) for case in cases]
        values = options.run(items, protocol).values
        rows += task2.tabulate([(case, values[item.key]) for case, item in zip(cases, items, strict=True)
                                if item.key in values], options.seed)
        reasons |= dict.fromkeys((case.flight.name for case in cases), ALL_FAILED)
    for row in rows:
        row["clock"] = options.clock
    _show(options, rows)
    return {"gate": [], "gate_note": task2.GATE_NOTE, "rows": rows,
            "left_out": show_left_out(options, flights, rows, audits, task2.NEEDED, reasons)}


def _show(options: Options, rows: Sequence[Mapping[str, Any]]) -> None:
    lines = []
    for row in rows:
        head = [row["reference"], row["speed"] or "-", row["controller"], str(row["n"])]
        lines.append((head, row["statistics"]))
        if published := row.get("published"):
            lines.append((["(published)", row["speed"] or "-", row["controller"], str(row["published_n"])], published))
    title = (f"Task 2, onboard controllers as flown: {data_word(options)} data, clock {options.clock}, mean ± SD over "
             "n flights and 95 % interval of the mean RMSE")
    options.show(score_table(title, ("reference", "speed", "controller", "n"), COLUMNS, lines))
    dropped = dict.fromkeys(name for row in rows for name in row["dropped"])
    if dropped:
        options.show(one_line("Left out of the published rows because RMSE > 1 m, as was published: "
                              f"{', '.join(dropped)}"))

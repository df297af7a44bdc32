"""Task 2 on logged flights, and what a terminal shows of it: what ``nanobench control`` and ``nb.control`` are made of.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..tables.result_table import Table
from ..time_offsets.moving.votes import evidence_of
from .options import Options, one_line
from .result_bodies import ControlBody
from .show import ALL_FAILED, data_word, interval_text, score_table, score_text, sessions_text, show_left_out

if TYPE_CHECKING:
    from ..auditing.recording_audit import Audit
    from ..flight import Flight
    from ..protocols.task2 import TrackingRow
    from ..protocols.voltage_pairs import VoltagePairs

COLUMNS = (("rmse_m", "RMSE m", 1.0, 4), ("ade_m", "ADE m", 1.0, 4), ("velocity_rmse_m_s", "velocity m/s", 1.0, 4),
           ("heading_deg", "heading deg", 1.0, 3), ("divergence_percent", "> 0.5 m %", 1.0, 3),
           ("rmse_lag_removed_m", "lag removed m", 1.0, 4))


def control_screen(options: Options, body: ControlBody) -> list[Table | str]:
    """Logged flights by path and controller, the gate, and every simulated controller over all references."""
    from ..protocols.sessions import short_note
    from ..protocols.simulated import SimulatedRow
    from ..protocols.task2 import TrackingRow
    from .control_tables import together, with_disturbances

    word, parts = data_word(options), list[Table | str]()
    real = [row for row in body.rows if isinstance(row, TrackingRow)]
    for protocol in dict.fromkeys(row.protocol for row in real):
        mine = [row for row in real if row.protocol == protocol]
        most = sorted(mine, key=lambda row: (row.published is None, -row.n))
        parts.append(Table.plain(
            f"Task 2, {protocol}, {word} data: RMSE m, mean ± SD over n flights",
            ("reference", "speed", "controller", "n", "RMSE m", "95 %", "lag removed m"),
            [(row.reference, row.speed or "-", row.controller, str(row.n),
              score_text(row.statistics.get("rmse_m"), 1.0, 4), interval_text(row.statistics.get("rmse_m"), 1.0, 4),
              score_text(row.statistics.get("rmse_lag_removed_m"), 1.0, 4)) for row in most], short_note(mine)))
    if body.gate.gate:
        parts.append(Table.plain(
            f"Gate: {word} held-out flights flown again on the plant",
            ("flight", "RMSE recorded m", "simulated m", "ratio", "lag diff ms", "gap cm", "pass"),
            [(row.flight, f"{row.rmse_real_m:.3f}", f"{row.rmse_sim_m:.3f}", f"{row.ratio:.3f}",
              f"{1e3 * row.lag_diff_s:+.0f}", f"{100.0 * row.path_gap_m:.1f}", "yes" if row.passed else "no")
             for row in body.gate.gate]))
    elif body.gate.gate_note:
        parts.append(body.gate.gate_note)
    flown = [row for row in body.rows if isinstance(row, SimulatedRow)]
    if flown:
        disturbed = with_disturbances(flown[0].radio_delay_s, flown[0].wind_m_s, flown[0].radio_silent_percent / 100.0)
        parts.append(Table.plain(
            f"{'SYNTHETIC data: ' * options.synthetic}SIMULATED flights, all references together: medians over plants"
            f"{disturbed}",
            ("controller", "given", "references", "RMSE m", "worst decile m", "lost %"),
            [(one.controller, one.information, str(one.references), f"{one.rmse_m:.3f}", f"{one.worst_decile_m:.3f}",
              f"{one.lost_percent:.1f}") for one in together(flown)]))
    return parts


def control_body(options: Options, flights: Sequence[Flight], audits: Mapping[str, Audit],
                 protocols: Sequence[str] = (), controllers: Sequence[str] = ()) -> ControlBody:
    """control.json of logged flights, with the tables shown. Without ``protocols`` all that the data allow.

    Raises InputError when a selected protocol (or every one) has no flight to score.
    """
    from ..auditing.verb_needs import CONTROL
    from ..harness import make_item
    from ..protocols import task2
    from ..protocols.voltage_pairs import voltage_pairs

    rows: list[task2.TrackingRow] = []
    pairs: list[VoltagePairs] = []
    reasons: dict[str, str] = {}

    def select(protocol: str) -> list[task2.Case]:
        found = task2.select(flights, audits, protocol)
        cases = [case for case in found if not controllers or case.controller in controllers]
        reasons.update({case.flight.name: f"flown by {case.controller}, not requested" for case in found
                        if controllers and case.controller not in controllers})
        if not cases:
            raise InputError(found[0].flight.provenance.path, f"protocol {protocol!r} has no flight of "
                             f"{' or '.join(controllers)} among {len(flights)} recordings")
        return cases

    for protocol, cases in options.selected(protocols, task2.PROTOCOLS, select):
        items = [make_item(task2.score, {"case": case}, f"{protocol} {case.controller} {case.flight.name}",
                           file=case.flight.provenance.path) for case in cases]
        values = options.run(items, protocol).values
        scored = [(case, values[item.key]) for case, item in zip(cases, items, strict=True) if item.key in values]
        rows += task2.tabulate(scored, options.seed, options.sessions)
        pairs += voltage_pairs(scored, options.seed, options.sessions)
        reasons |= dict.fromkeys((case.flight.name for case in cases), ALL_FAILED)
    rows = [replace(row, clock=options.clock, clock_evidence=evidence_of(f for f in flights if f.name in row.flights))
            for row in rows]
    _show(options, rows)
    if pairs:
        options.detail(pairs_table(options, pairs))
    used = {name for row in rows for name in (*row.flights, *row.dropped)}
    return ControlBody(rows, left_out=show_left_out(options, flights, used, audits, CONTROL, reasons),
                       voltage_pairs=pairs or None)


def pairs_table(options: Options, pairs: Sequence[VoltagePairs]) -> Table:
    """Controllers over flights of equal path, speed and voltage."""
    from ..protocols.voltage_pairs import APART_V

    def told(pair: VoltagePairs, metric: str) -> str:
        found = pair.ratios[metric]
        if found.ratio is None:
            return "-"
        return f"{found.ratio:.3f}" + (f" [{found.ci95[0]:.3f}, {found.ci95[1]:.3f}]" if found.ci95 else "")

    return Table.plain(
        f"Task 2, {data_word(options)} flights in pairs of equal voltage: errors of one controller over another's",
        ("reference", "speed", "controller", "over", "pairs", "RMSE", "velocity", "lag removed"),
        [(p.reference, p.speed or "-", p.controller, p.over, str(p.n), told(p, "rmse_m"), told(p, "velocity_rmse_m_s"),
          told(p, "rmse_lag_removed_m")) for p in pairs],
        f"Mean voltages of a pair differ by at most {APART_V:g} V; every flight is in one pair at most.")


def _show(options: Options, rows: Sequence[TrackingRow]) -> None:
    from ..protocols.sessions import interval_note

    lines: list[tuple[list[str], Mapping[str, Any]]] = []
    for row in rows:
        head = [row.reference, row.speed or "-", row.controller, str(row.n), sessions_text(row.drawn.sessions)]
        lines.append((head, row.statistics))
        if row.published is not None:
            head = ["(published)", row.speed or "-", row.controller, str(row.published.published_n), ""]
            lines.append((head, row.published.published))
    title = (f"Task 2, onboard controllers as flown: {data_word(options)} data, clock {options.clock}, mean ± SD over "
             "n flights and 95 % interval of the mean RMSE")
    options.detail(score_table(title, ("reference", "speed", "controller", "n", "sessions"), COLUMNS, lines))
    options.detail(interval_note(rows, [name for name, *_ in COLUMNS]))
    dropped = dict.fromkeys(name for row in rows for name in row.dropped)
    if dropped:
        options.detail(one_line("Left out of the published rows because RMSE > 1 m, as was published: "
                              f"{', '.join(dropped)}"))

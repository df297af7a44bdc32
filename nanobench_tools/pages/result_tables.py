"""Result files (shape of the JSON contract) into tables: one builder per table."""

from collections.abc import Mapping
from typing import Any

from ..tables.result_table import Column, Score, Table
from .audit_entry import CLOCK_STREAMS, fault_counts, share_clean, total
from .row_cells import DATA, count_of, data_label, reason_of, score_column, text_of
from .sysid_tables import task1, task1_clocks, task1_commands, task1_parameters, task1_ratios
from .task2_tables import task2, task2_gate
from .task3_tables import task3


def tables_of(results: Mapping[str, Mapping[str, Any]], synthetic: bool) -> list[Table]:
    """Every table the results allow, in the order of the page; a result that is absent makes none."""
    tables: list[Table] = []
    if sysid := results.get("sysid"):
        tables += [task1(sysid, synthetic), task1_commands(sysid, synthetic), task1_clocks(sysid, synthetic),
                   task1_ratios(sysid, synthetic), *task1_parameters(sysid, synthetic)]
    if thrust := results.get("thrust"):
        tables.append(thrust_maps(thrust, synthetic))
    if control := results.get("control"):
        tables += [*task2(control, synthetic), *task2_gate(control, synthetic)]
    if estimate := results.get("estimate"):
        tables += task3(estimate, synthetic)
    if audit := results.get("audit"):
        tables.append(audit_flights(audit, synthetic))
    return [table for table in tables if table.rows]


def thrust_maps(thrust: Mapping[str, Any], synthetic: bool) -> Table:
    """Rows of ``thrust``."""
    scores = tuple(score_column(name) for name in ("rms_N", "rms_m_s2"))
    lines = tuple((text_of(r.get("model")), text_of(r.get("split")), count_of(r.get("n")), data_label(synthetic),
                   *(Score.of(r.get(c.key), reason=reason_of(r, c.key)) for c in scores))
                  for r in thrust.get("rows", []))
    return Table("table_thrust", "Thrust maps: error of the predicted thrust",
                 (Column("model", "Model"), Column("split", "Split"), Column("n", "n", "count"), DATA, *scores),
                 lines).without_empty_columns()


def audit_flights(audit: Mapping[str, Any], synthetic: bool) -> Table:
    """One row per recording: what flew, how much of it is usable, what is wrong, how late the clock is."""
    columns = (Column("flight", "Flight"), Column("controller", "Controller"), DATA,
               Column("length_s", "Length", "score", "s", 1.0, 1),
               Column("airborne_s", "Airborne", "score", "s", 1.0, 1),
               Column("clean_s", "Clean", "score", "s", 1.0, 1), Column("clean_percent", "Clean", "score", "%", 1.0, 1),
               Column("clock_offset_s", "Clock offset", "score", "ms", 1e3, 1),
               Column("clock_wander_s", "Clock wander SD", "score", "ms", 1e3, 1), Column("faults", "Faults"),
               Column("sha256", "SHA-256"))
    lines = []
    for flight in audit.get("flights", []):
        share = share_clean(flight)
        stream = next((s for s in CLOCK_STREAMS if s in (flight.get("clock") or {})), None)
        clock = (flight.get("clock") or {}).get(stream) or {}
        why = clock.get("reason") or "no clock was compared with the motion capture"
        lines.append((
            text_of(flight.get("flight")), text_of(flight.get("controller")), data_label(synthetic),
            Score.of(total([flight["span"]]) if flight.get("span") else None), Score.of(total(flight.get("airborne"))),
            Score.of(total(flight.get("clean"))), Score.of(None if share is None else 100 * share),
            Score.of(clock.get("offset_s") if clock.get("identifiable", True) else None, clock.get("ci95_s"), why),
            Score.of(clock.get("wander_sd_s"), reason="the wander of the clock is not known"),
            ", ".join(f"{kind} ×{n}" if n > 1 else kind for kind, n in fault_counts(flight).items()) or "none",
            text_of(flight.get("sha256"))[:12]))
    return Table("audit_flights", "Data audit: every recording", columns, tuple(lines),
                 f"Clock offset of {' or '.join(CLOCK_STREAMS[:1])} against motion capture, positive when the "
                 "timestamps are late.")

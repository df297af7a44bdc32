"""Tables of Task 2 from control.json."""

from collections.abc import Mapping, Sequence
from typing import Any

from ..tables.result_table import Cell, Column, Score, Table
from .row_cells import (
    CLOCK,
    DATA,
    SESSIONS,
    WHY,
    clock_in_place,
    count_of,
    data_label,
    drop_blank,
    metrics_of,
    noted,
    score_column,
    scores_of,
    session_cells,
    text_of,
)

CONTROL_METRICS = ("rmse_m", "ade_m", "velocity_rmse_m_s", "heading_deg", "divergence_percent", "lag_s",
                   "rmse_lag_removed_m", "contour_rmse_m", "z_bias_m", "worst_decile_m", "saturated_percent",
                   "solve_p99_ms")


def task2(control: Mapping[str, Any], synthetic: bool) -> list[Table]:
    """Rows of ``control``: real flights in one table, simulated ones (if any) in another."""
    rows = [row if row.get("plant") == "simulated" else {**row, "metrics": row.get("statistics") or row.get("metrics")}
            for row in control.get("rows", [])]
    scores = tuple(score_column(name) for name in metrics_of(rows, CONTROL_METRICS))
    columns = (Column("protocol", "Protocol"), CLOCK, Column("controller", "Controller"),
               Column("reference", "Reference"), Column("speed", "Speed"),
               Column("speed_m_s", "Speed", "score", "m/s", 1.0, 2), Column("n", "n", "count"), SESSIONS, WHY,
               *scores, Column("information", "Given"), DATA)
    titles = {"real": ("table_task2", "Task 2: tracking on logged flights"),
              "simulated": ("table_task2_simulated", "Task 2: tracking on the simulated plants")}
    tables = []
    for plant, (name, title) in titles.items():
        lines: list[tuple[Cell, ...]] = []
        mine = [row for row in rows if (row.get("plant") or "real") == plant]
        for row in mine:
            head = (text_of(row.get("controller")), text_of(row.get("reference")), text_of(row.get("speed")),
                    Score.of(row.get("speed_m_s"), reason="no single reference speed"))
            information = text_of(row.get("information"))
            if published := row.get("published"):
                lines.append(("published table", "", *head, count_of(row.get("published_n")), None, "",
                              *scores_of(published, {}, scores, exact=True), information, "published"))
            lines.append((text_of(row.get("protocol")), text_of(row.get("clock")), *head, count_of(row.get("n")),
                          *session_cells(row),
                          *scores_of(row.get("metrics"), row, scores), information, data_label(synthetic)))
        dropped = dict.fromkeys(name for row in mine for name in row.get("dropped") or [])
        note = noted("Mean ± SD over flights and 95 % interval of the mean.", mine)
        if plant == "simulated":
            note = _simulated_note(mine)
        if dropped:
            note += f" Left out of the published rows, as was published: {', '.join(map(str, dropped))}."
        tables.append(Table(name, title, columns, tuple(lines), note).without_empty_columns())
    return [clock_in_place(drop_blank(drop_blank(table, "protocol"), "speed")) for table in tables if table.rows]


def _simulated_note(rows: Sequence[Mapping[str, Any]]) -> str:
    bar = next((row["error_bar"] for row in rows if row.get("error_bar")), None)
    note = "Medians over an ensemble of plants; the worst decile is the RMSE that one plant in ten exceeds."
    if bar is None:
        return f"{note} No flight has judged this plant: these numbers have no error bar."
    return (f"{note} Error bar of every RMSE by the gate ({bar['n']} flights): {100.0 * bar['rmse_share']:.0f} % "
            f"(median), {100.0 * bar['rmse_share_p90']:.0f} % (one flight in ten is further off).")


def task2_gate(control: Mapping[str, Any], synthetic: bool) -> list[Table]:
    """How close the simulated plant comes to each logged flight."""
    gate = control.get("gate") or []
    scores = tuple(score_column(name) for name in ("rmse_real_m", "rmse_sim_m", "ratio", "lag_diff_s", "path_gap_m"))
    lines = tuple((text_of(g.get("flight")), text_of(g.get("controller")), data_label(g.get("synthetic", synthetic)),
                   "yes" if g.get("pass") else "no", text_of(g.get("reason")), *scores_of(g, g, scores))
                  for g in gate)
    columns = (Column("flight", "Flight"), Column("controller", "Controller"), DATA, Column("pass", "Passes"),
               Column("reason", "Reason"), *scores)
    title = "Task 2: the plant against the logged flights (its error bar)"
    return [Table("table_task2_gate", title, columns, lines).without_empty_columns()] if lines else []

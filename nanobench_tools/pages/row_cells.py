"""What tables of all tasks share: columns, cells, clocks and notes of rows as result files hold them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..protocols.sessions import interval_note
from ..tables.quantities import shown
from ..tables.result_table import Cell, Column, Score, Table

PUBLISHED = "as-published"
SPEEDS = ("slow", "medium", "fast")
SYSID_METRICS = ("position_mae_m", "velocity_mae_m_s", "attitude_mae_rad", "rate_mae_rad_s")
DATA = Column("data", "Data")
AS_RECORDED = "as-recorded"
CLOCK = Column("clock", "Clock")
SESSIONS = Column("sessions", "Sessions", "count")
WHY = Column("ci_why", "Interval missing or not to be trusted", aside=True)
RATIO_NOTE = ("Error over that of the row named, the same flights and windows drawn for both, and its 95 % interval. "
              "An interval that holds 1 shows no difference.")
RATIOS = (("ratio", "ratio_to"), ("clock_ratio", "clock_ratio_to"))
"""Keys of a row that is compared: with another method on its clock, with itself as recorded."""


def clock_of(row: Mapping[str, Any]) -> str:
    """The clock of a row; results from before there were several are as recorded."""
    return str(row.get("clock") or AS_RECORDED)


def of_one_clock(rows: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The rows as recorded, if there are any, else those of the first other clock: never two clocks side by side."""
    rows = list(rows)
    clocks = {clock_of(row) for row in rows}
    chosen = AS_RECORDED if AS_RECORDED in clocks or not rows else clock_of(rows[0])
    return [row for row in rows if clock_of(row) == chosen]


def data_label(synthetic: bool) -> str:
    """The word in every row that says what the numbers were made from."""
    return "SYNTHETIC" if synthetic else "real"


def one_truth(rows: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Rows of Task 1 judged by the truth the published table used, or by the only one there is, from its start."""
    rows = [r for r in rows if r.get("start", "centred") == "centred"]
    truths = list(dict.fromkeys(r.get("truth") for r in rows))
    chosen = "onboard" if "onboard" in truths else (truths or [None])[0]
    return [r for r in rows if r.get("truth") == chosen]


def rank_of(name: str, order: Sequence[str]) -> int:
    return order.index(name) if name in order else len(order)


def score_column(name: str) -> Column:
    how = shown(name)
    return Column(name, how.title, "score", how.unit, how.factor, how.decimals)


def metrics_of(rows: Sequence[Mapping[str, Any]], order: Sequence[str]) -> list[str]:
    """The metrics in ``rows``: the known ones in their order, then the others as found."""
    found = dict.fromkeys(name for row in rows for name in (row.get("metrics") or {}))
    return [name for name in order if name in found] + [name for name in found if name not in order]


def scores_of(metrics: Any, row: Mapping[str, Any], columns: Sequence[Column], exact: bool = False) -> list[Score]:
    metrics, intervals = metrics or {}, row.get("ci95") or {}
    return [Score.of(metrics.get(c.key), intervals.get(c.key), reason_of(row, c.key), exact) for c in columns]


def reason_of(row: Mapping[str, Any], metric: str) -> str:
    reasons = row.get("reasons") or {}
    return str(reasons.get(metric) or row.get("reason") or Score(None).reason)


def drop_blank(table: Table, key: str) -> Table:
    """Less the column ``key`` when no row has anything in it."""
    i = next(k for k, c in enumerate(table.columns) if c.key == key)
    return table if any(row[i] for row in table.rows) else table.without_column(key)


def clock_in_place(table: Table) -> Table:
    """Clocks are among the names of the rows where rows have several. Otherwise they are at the end, or left out where
    no row has one."""
    i, end = ([c.key for c in table.columns].index(key) for key in ("clock", "data"))
    clocks = {str(row[i] or "") for row in table.rows[:table.main]} - {""}
    if len(clocks) > 1:
        return table
    if not any(row[i] for row in table.rows):
        return table.without_column("clock")
    order = [*range(i), *range(i + 1, end), i, *range(end, len(table.columns))]
    return replace(table, columns=tuple(table.columns[k] for k in order),
                   rows=tuple(tuple(row[k] for k in order) for row in table.rows))


def session_cells(row: Mapping[str, Any]) -> tuple[Cell, Cell]:
    """Number of sessions, and why the row's intervals are missing or not to be trusted."""
    return count_of(row.get("sessions")), text_of(row.get("ci_why"))


def noted(note: str, rows: Sequence[Mapping[str, Any]], metrics: Sequence[str] = ()) -> str:
    """``note`` with what the intervals of the table are."""
    return f"{note} {interval_note(rows, metrics)}".strip()


def text_of(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, (list, tuple)):
        return ", ".join(map(str, value))
    return str(value)


def count_of(value: Any) -> int | None:
    return int(value) if isinstance(value, int) and not isinstance(value, bool) else None

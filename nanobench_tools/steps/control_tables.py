"""Tables of simulated flights for a person at a terminal: by reference, all references together, and mismatches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..results.result import Result
from .options import Options, one_line
from .show import rich_table

if TYPE_CHECKING:
    from ..protocols.simulated import ErrorBar, MismatchRow, SimulatedRow

TO_BEAT = ("lead_pid", "mellinger_full")


def speed_text(row: SimulatedRow | MismatchRow) -> str:
    return "-" if row.speed_m_s is None else f"{row.speed_m_s:g}"


def number(value: float | None, digits: int) -> str:
    """``-`` for a missing value."""
    return "-" if value is None or not np.isfinite(value) else f"{value:.{digits}f}"


def with_disturbances(radio_s: float, wind_m_s: float, silent: float) -> str:
    """", radio 20 ms, radio silent 8 %, wind 1 m/s" of what is there; silent: share of the time."""
    return (f", radio {1e3 * radio_s:g} ms" * (radio_s > 0.0) + f", radio silent {100.0 * silent:g} %" * (silent > 0.0)
            + f", wind {wind_m_s:g} m/s" * (wind_m_s > 0.0))


def show_simulated(options: Options, rows: Sequence[SimulatedRow], bar: ErrorBar | None,
                   radio_s: float, wind_m_s: float, silent: float) -> None:
    """By reference and speed, the best first; then every controller over all of them; then the disturbances."""
    off = "no gate" if bar is None else f"± {100.0 * bar.rmse_share:.0f} % by the gate of {bar.n} flights"
    flown_with = with_disturbances(radio_s, wind_m_s, silent)
    table = rich_table(f"Task 2, SIMULATED flights, median and worst decile of n plants ({off}{flown_with})",
                       ("reference", "m/s", "controller", "information", "n"),
                       ("RMSE m", "worst decile m", "lag removed m", "contour m", "> 0.5 m %", "at cap %", "lost %",
                        "p99 ms"))
    group = None
    for row in sorted(rows, key=lambda r: (r.reference, r.speed_m_s or 0.0, _order(r.metrics["rmse_m"]))):
        m, mine = row.metrics, (row.reference, speed_text(row))
        if group not in (None, mine):
            table.add_section()
        heads = ("", "") if group == mine else mine
        group = mine
        around = number(m["rmse_m"], 3)
        if bar is not None and around != "-":
            around += f" ± {m['rmse_m'] * bar.rmse_share:.3f}"
        table.add_row(*heads, one_line(row.controller), row.information, str(row.n), around,
                      number(m["worst_decile_m"], 3), number(m["rmse_lag_removed_m"], 3),
                      number(m["contour_rmse_m"], 3), number(m["divergence_percent"], 1),
                      number(m["saturated_percent"], 1), number(m["lost_percent"], 0), number(m["solve_p99_ms"], 3))
    options.detail(table)
    _show_together(options, rows)
    for row in rows:
        for what in ("gust", "outage"):
            if (bent := getattr(row, what)) is not None:
                most, back = bent["most_m"], bent["back_s"]
                options.detail(f"{one_line(row.controller)}, {row.reference}, {what}: "
                             f"{number(most.median, 2)} m away (worst decile {number(most.p90, 2)}), back "
                             f"within 5 cm after {number(back.median, 1)} s")


def _order(value: float | None) -> float:
    return float("inf") if value is None or not np.isfinite(value) else value


@dataclass(frozen=True, repr=False)
class Together(Result):
    """One controller over all references: medians over them, the largest worst decile, the mean share of lost ones;
    ``gain_over``: of each controller to beat (least gain, references better by 30 %, references)."""

    controller: str
    information: str
    references: int
    rmse_m: float
    contour_rmse_m: float
    worst_decile_m: float
    lost_percent: float
    gain_over: Mapping[str, tuple[float, int, int]]


def together(rows: Sequence[SimulatedRow]) -> list[Together]:
    """Of each controller, the best first."""
    found = []
    by_name = {(r.controller, r.reference, r.speed_m_s): _order(r.metrics["rmse_m"]) for r in rows}
    for name in dict.fromkeys(row.controller for row in rows):
        mine = [row for row in rows if row.controller == name]
        values = {key: [_order(row.metrics[key]) for row in mine]
                  for key in ("rmse_m", "contour_rmse_m", "worst_decile_m", "lost_percent")}
        gains = {}
        for other in TO_BEAT:
            shares = [1.0 - own / by_name[key] for row, own in zip(mine, values["rmse_m"], strict=True)
                      if (key := (other, row.reference, row.speed_m_s)) in by_name and np.isfinite(by_name[key])]
            if shares and other != name:
                gains[other] = (min(shares), sum(share >= 0.3 for share in shares), len(shares))
        found.append(Together(name, mine[0].information, len(mine), float(np.median(values["rmse_m"])),
                              float(np.median(values["contour_rmse_m"])), max(values["worst_decile_m"]),
                              float(np.mean(values["lost_percent"])), gains))
    return sorted(found, key=lambda one: one.rmse_m)


def _show_together(options: Options, rows: Sequence[SimulatedRow]) -> None:
    table = rich_table("All references together; the last columns: references with at least 30 % less RMSE, and the "
                       "least gain", ("controller", "information"),
                       ("references", "median RMSE m", "contour m", "largest worst decile m", "lost %",
                        *(f"30 % below {name}" for name in TO_BEAT)))
    for one in together(rows):
        better = ["-" if (g := one.gain_over.get(name)) is None else f"{g[1]} of {g[2]}, {100.0 * g[0]:+.0f} %"
                  for name in TO_BEAT]
        table.add_row(one_line(one.controller), one.information, str(one.references), number(one.rmse_m, 3),
                      number(one.contour_rmse_m, 3), number(one.worst_decile_m, 3),
                      number(one.lost_percent, 1), *better)
    options.detail(table)


def show_mismatch(options: Options, rows: Sequence[MismatchRow]) -> None:
    """A line for each case, a column for each controller: the largest RMSE over the references, or lost."""
    names = list(dict.fromkeys(row.controller for row in rows))
    what = ", ".join(dict.fromkeys(f"{row.reference} {speed_text(row)}".removesuffix(" -") for row in rows))
    table = rich_table(f"Plants unlike what controllers assume, SIMULATED: largest RMSE m over {what}; lost: "
                       "further than 2 m away", ("case",), map(one_line, names))
    for case in dict.fromkeys(row.case for row in rows):
        cells = []
        for name in names:
            mine = [row.metrics for row in rows if row.case == case and row.controller == name]
            cells.append("lost" if any(m["lost_percent"] for m in mine) else
                         number(max((_order(m["rmse_m"]) for m in mine), default=float("nan")), 3))
        table.add_row(case, *cells)
    options.detail(table)

"""What a verb found, in a sentence for the terminal and for Python."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..tables.method_names import fit_in_words, quoted
from ..tables.quantities import format_number, shown

if TYPE_CHECKING:
    from ..protocols.compare import ClockRanking
    from ..protocols.result_rows import EstimateRow
    from ..protocols.task1 import PredictionRow
    from .result_bodies import ControlBody, SysidBody

ESTIMATED = {"ate_rmse_m": "ATE", "end_error_5s_m": "error 5 s after the last pose", "drift_percent": "drift"}
"""The metric that stands for a protocol, the first that a row has -> its words; units are those of the tables."""
PUBLISHED = "as-published"
"""How the names of protocols begin that score as the published table does."""
CLOCK_WORDS = {"as-recorded": "as recorded", "retimed": "re-timed", "offset": "with the constant offset removed",
               "joint": "on the joint clock"}


def estimated(rows: Sequence[EstimateRow], rankings: Sequence[ClockRanking] = ()) -> str:
    """The smallest error of each protocol over all its flights, with its interval, among methods with the same inputs.
    Also whether the choice depends on the clock.

    Other clocks than the first, and the published protocol next to corrected ones, are left to the tables.
    """
    rows = [row for row in rows if row.clock == rows[0].clock]
    rows = [row for row in rows if not row.protocol.startswith(PUBLISHED)] or rows
    found = []
    for protocol in dict.fromkeys(row.protocol for row in rows):
        of_protocol = [row for row in rows if row.protocol == protocol]
        groups = dict.fromkeys(row.group for row in of_protocol)
        for group in ["all"] if "all" in groups else groups:
            mine = [row for row in of_protocol if row.group == group]
            inputs = dict.fromkeys(row.inputs for row in mine)
            parts = [part for given in inputs if (part := _smallest(
                [row for row in mine if row.inputs == given], f" given {given}" * (len(inputs) > 1)))]
            if parts:
                when = "" if mine[0].clock == "as-recorded" else f", {CLOCK_WORDS.get(mine[0].clock, mine[0].clock)}"
                found.append(f"{protocol}{f' {group}' * (group != 'all')}{when}: {', '.join(parts)}")
    return ". ".join([*found, *(sentence for one in rankings if (sentence := by_clock(one)))])


def by_clock(ranking: ClockRanking) -> str:
    """That the clock decides which method is best; empty where it does not."""
    if not ranking.decides:
        return ""
    best = ", ".join(f"{method} {CLOCK_WORDS.get(clock, clock)}" for clock, method in ranking.best.items())
    return f"The clock decides which is best in {ranking.protocol}: {best}"


def _smallest(rows: Sequence[EstimateRow], given: str) -> str:
    metric = next((m for m in ESTIMATED if any(m in row.metrics for row in rows)), None)
    judged = [(mean, row) for row in rows if metric in row.metrics
              and (mean := row.metrics[metric].mean) is not None] if metric else []
    if not metric or not judged:
        return ""
    how = shown(metric)
    mean, best = min(judged, key=lambda pair: pair[0])
    low, high = best.metrics[metric].ci95 or (None, None)

    def text(value: float | None) -> str:
        return "" if value is None else format_number(how.factor * value, how.decimals, like=how.factor * mean)

    least = "smallest " * (len({row.method for _, row in judged}) > 1)
    inside = "" if low is None else f" [{text(low)}, {text(high)}]"
    return f"{least}{ESTIMATED[metric]} {text(mean)} {how.unit}{inside} by {best.method}{given} ({_flights(best.n)})"


def interval(ci95: Sequence[float] | None) -> str:
    """`` [lo, hi]`` behind a number; empty without an interval."""
    return "" if ci95 is None else f" [{ci95[0]:.3g}, {ci95[1]:.3g}]"


def controlled(body: ControlBody) -> str:
    """The row of most flights of each onboard controller, what the gate says, the closest simulated controller."""
    from ..protocols.simulated import SimulatedRow
    from ..protocols.task2 import TrackingRow
    from .control_tables import together

    found = []
    real = [row for row in body.rows if isinstance(row, TrackingRow)]
    for name in dict.fromkeys(row.controller for row in real):
        row = max((row for row in real if row.controller == name), key=lambda row: row.n)
        rmse = row.metrics.get("rmse_m")
        if rmse is not None:
            where = " ".join(filter(None, (row.reference, row.speed)))
            found.append(f"{name}: RMSE {rmse:.3g} m along {where} ({_flights(row.n)})")
    if body.gate.summary is not None and (gate := body.gate.summary.get("all")) is not None:
        found.append(f"gate: {round(gate.pass_share * gate.n)} of {gate.n} flights pass")
    flown = [row for row in body.rows if isinstance(row, SimulatedRow)]
    if flown:
        best = together(flown)[0]
        found.append(f"simulated: closest is {best.controller}, median RMSE {best.rmse_m:.3g} m over "
                     f"{best.references} reference{'s' * (best.references != 1)}")
    return "; ".join(found)


def predicted(body: SysidBody) -> str:
    """The best model of class state, and how far off it is after half a second."""
    best = body.models.best
    rows = [row for row in body.rows if row.group == "all" and row.start == "centred"]
    row = next((row for row in rows if row.model == best), None)
    if row is None:
        return f"{len({row.model for row in body.rows})} models scored, none is chosen"
    alike = [other for other in rows if not other.trouble
             and (other.clock, other.truth, other.information) == (row.clock, row.truth, row.information)]
    least = min([row, *alike], key=_off_m)
    but = "" if least is row else (
        f"; smallest error on these flights: {quoted(fit_in_words(least.model))}, {_off_m(least):.3g} m")
    where = " on the training flights" if but else ""
    return (f"best of class state{where}: {quoted(fit_in_words(best))}, off by {_off_m(row):.3g} m after half a second "
            f"({_flights(row.n_flights)}){but}")


def _off_m(row: PredictionRow) -> float:
    return row.metrics["position_mae_m"]["50"]


def _flights(n: int) -> str:
    return f"{n} flight{'s' * (n != 1)}"


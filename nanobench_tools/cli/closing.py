"""How a verb ends: its result in a line or two, and the next command, which works when it is pasted."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..steps.options import Options, one_line

if TYPE_CHECKING:
    from ..steps.result_bodies import ControlBody, EstimateBody, SysidBody

WORDS = "nanobench.words"
"""Where the context keeps the words of the command line."""
ESTIMATED = {"ate_rmse_m": ("ATE", "m"), "end_error_5s_m": ("error 5 s after the last pose", "m"),
             "drift_percent": ("drift", "%")}
"""The metric that stands for a protocol, the first that a row has -> its words and unit."""


def close(options: Options, result: str, why: str = "", *command: object) -> None:
    """Shows ``result`` and, where there is one, the next ``command`` (its words) and what it is for."""
    if result:
        options.show(one_line(result))
    if command:
        options.show(f"Next, {one_line(why)}: {one_line(shlex.join(map(str, command)))}", fold=False)


def again(*more: object) -> list[object]:
    """The words of this command, and ``more`` behind them."""
    context = click.get_current_context(silent=True)
    return ["nanobench", *(context.meta.get(WORDS, ()) if context is not None else ()), *more]


def same(options: Options) -> list[object]:
    """What makes another verb read the same recordings: their paths and the column map."""
    return [*options.data, *(["--columns", options.columns] if options.columns is not None else [])]


def shown_page(path: Path) -> tuple[str, ...]:
    """The command that opens a page."""
    return ("python", "-m", "webbrowser", str(path.absolute()))


def close_scores(options: Options, result: str, kind: str) -> None:
    """Of a verb that scores methods: its page where results were written, else a method of one's own."""
    if options.out is not None:
        close(options, result, "as a page with pictures", "nanobench", "report", options.out, *_recordings(options))
    else:
        close(options, result, f"a {kind} of your own beside these", "nanobench", "new", kind, f"my_{kind}")


def _recordings(options: Options) -> list[object]:
    return [word for path in options.data for word in ("--data", path)]


def estimated(body: EstimateBody) -> str:
    """The least error of each protocol over all its flights."""
    found = []
    for protocol in dict.fromkeys(row.protocol for row in body.rows):
        mine = [row for row in body.rows if row.protocol == protocol and row.group == "all"]
        mine = mine or [row for row in body.rows if row.protocol == protocol]
        metric = next((m for m in ESTIMATED if any(m in row.metrics for row in mine)), None)
        if metric is None:
            continue
        judged = [(mean, row) for row in mine
                  if metric in row.metrics and (mean := row.metrics[metric].mean) is not None]
        if judged:
            words, unit = ESTIMATED[metric]
            mean, best = min(judged, key=lambda pair: pair[0])
            found.append(f"{protocol}: least {words} {mean:.3g} {unit} by {best.method} "
                         f"({_flights(best.n)})")
    return "; ".join(found)


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
    row = next((row for row in body.rows if row.model == best and row.group == "all" and row.start == "centred"), None)
    if row is None:
        return f"{len({row.model for row in body.rows})} models scored, none is chosen"
    return (f"best of class state: {best}, off by {row.metrics['position_mae_m']['50']:.3g} m after half a second "
            f"({_flights(row.n_flights)})")


def _flights(n: int) -> str:
    return f"{n} flight{'s' * (n != 1)}"


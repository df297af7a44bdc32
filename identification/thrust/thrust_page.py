"""thrust.html: the maps of ``nanobench thrust`` on one page that asks the network for nothing."""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from nanobench_tools.pages.environment import environment
from nanobench_tools.pages.figure import (
    COLOURS,
    SYMBOLS,
    Axis,
    Colour,
    Drawing,
    Figure,
    Mark,
    Panel,
    before_and_after,
)
from nanobench_tools.pages.packed import compressed
from nanobench_tools.pages.plotly_json import spec
from nanobench_tools.pages.report_page import FIGURE_SCRIPTS, breakable, library, template
from nanobench_tools.protocols.sessions import interval_note
from nanobench_tools.results.fitted_values import Estimate
from nanobench_tools.tables.quantities import DASH
from nanobench_tools.version import __version__

from .error_rows import ErrorRow, InverseTable, Points
from .map_words import in_words
from .thrust_formula import MEANING
from .thrust_result import FlightResult, Series, StandResult, ThrustResult

SECTIONS = {"stand": "Thrust stand", "flight": "Flights"}
FEW = 8
"""More files than this are distinguished by split only."""
VOLTAGES: tuple[Colour, ...] = ("red", "orange", "green", "sky", "blue")
UNITS = {"stand": (1e3, "mN per motor", 2), "flight": (1.0, "m/s²", 4)}


def thrust_page(found: ThrustResult, title: str, synthetic: bool, assumed: str = "") -> str:
    """The page as text. ``title``: the recordings; ``synthetic``: every caption says so; ``assumed``: see
    ``ThrustFormula.described``."""
    parts = [part(kind, mine, [r for r in found.rows if r.kind == kind], assumed)
             for kind, mine in (("stand", found.stand), ("flight", found.flight)) if mine is not None]
    drawings = {f"{p['kind']}-{name}": figure for p in parts for name, figure in (p["lead"] | p["figures"]).items()}
    return environment(breakable=breakable, dash=DASH).get_template("thrust.html").render(
        label="SYNTHETIC" if synthetic else "", title=title, made="", version=__version__, parts=parts,
        library=library(), css=template("report.css"), scripts=[template(name) for name in FIGURE_SCRIPTS],
        left_out=found.left_out, failed=[], data=compressed({name: spec(figure) for name, figure in drawings.items()}))


def part(kind: str, mine: StandResult | FlightResult, rows: Sequence[ErrorRow], assumed: str = "") -> dict[str, Any]:
    """What the page says and draws of one kind."""
    factor, unit, digits = UNITS[kind]
    before = getattr(mine, "as_recorded", None)
    rows = sorted([*(before.rows if before else ()), *rows], key=lambda r: r.split != "test")  # held out first
    chosen = mine.chosen
    drawn = figures(kind, mine)
    lead = {"map": drawn.pop("map")} if "map" in drawn else {}
    return {"kind": kind, "title": SECTIONS[kind], "best": mine.best and in_words(mine.best), "split": mine.split,
            "unit": unit, "words": words(kind, mine, rows), "rows": [_row(r, factor, digits, mine.best) for r in rows],
            "parameters": [_parameter(name, value) for name, value in mine.parameters.get(mine.best or "", {}).items()],
            "series": [_series(s) for s in getattr(mine, "series", ())],
            "inverse": None if chosen is None else _inverse(chosen.inverse),
            "toml": "" if chosen is None else chosen.toml, "firmware": "" if chosen is None else chosen.firmware,
            "firmware_note": "" if chosen is None else chosen.firmware_note,
            "terms_mN": None if chosen is None else f"{1e3 * chosen.terms_rms_N:.2f}", "figures": drawn, "lead": lead,
            "formula": "" if chosen is None else chosen.formula.text, "symbols": MEANING,
            "levels": "" if chosen is None else chosen.formula.described(assumed)}


def figures(kind: str, mine: StandResult | FlightResult) -> dict[str, Drawing]:
    """The chosen map, its residual over PWM and voltage, and held-out files against the firmware."""
    factor, unit, _ = UNITS[kind]
    chosen = mine.chosen
    if chosen is None:
        return {}
    lines = [Mark(f"{c.voltage_V:g} V", c.pwm, [1e3 * t for t in c.thrust_N], colour=colour)
             for c, colour in zip(chosen.curves, VOLTAGES, strict=False)]
    rows = "Marks: rows of the series, thrust per motor." if kind == "stand" else "Motors warm, hovering."
    seen = _points(chosen.points, lambda p: p.pwm, lambda p: [1e3 * t for t in p.measured]) if kind == "stand" else []
    found: dict[str, Drawing] = {"map": Figure(
        f"The chosen map, {in_words(str(mine.best))}", f"Lines: thrust of one motor at battery voltages. {rows}",
        [Panel(Axis("PWM ratio", "1"), Axis("thrust of one motor", "mN"), [*lines, *seen], height=420, wide=True)])}

    def left(p: Points) -> list[float]:
        return [factor * (v - m) for v, m in zip(p.predicted, p.measured, strict=True)]

    edge = chosen.interval_half_width
    rules = [] if edge is None else [("y", factor * edge), ("y", -factor * edge)]
    panels = [Panel(Axis(title, of), Axis("error", unit, zero=True), marks, height=340, rules=rules)
              for title, of, marks in (("PWM ratio", "1", _points(chosen.points, lambda p: p.pwm, left)),
                                       ("battery", "V", _points(chosen.points, lambda p: p.voltage_V, left)))
              if any(x is not None for mark in marks for x in mark.x)]
    if panels:
        found["left"] = Figure("Residual over PWM and battery voltage",
                               "Prediction minus measurement; dotted: the 95 % prediction interval for a row of a new "
                               "file. At most 300 rows of a file are drawn.", panels)
    if pairs := sorted(mine.against_firmware, key=lambda p: -p.rms):
        found["files"] = Figure("Held-out files: chosen map and firmware", "RMS of each file; the firmware is the "
                                "better of its two curves, as published.",
                                [before_and_after("RMS", unit, [p.file for p in pairs],
                                                  ("firmware", [factor * p.firmware for p in pairs]),
                                                  ("chosen map", [factor * p.rms for p in pairs]))])
    return found


def _points(points: Sequence[Points], x: Callable[[Points], Iterable[float | None]],
            y: Callable[[Points], Iterable[float]]) -> list[Mark]:
    """A mark per file, or one per split where there are too many files for a legend."""
    if len(points) <= FEW:
        groups = {f"{p.file} ({p.split})": [p] for p in points}
    else:
        groups = {}
        for p in points:
            groups.setdefault("flights that train" if p.split == "train" else "flights held out", []).append(p)
    size = 6.0 if len(points) <= FEW else 3.0
    return [Mark(name, [v for p in mine for v in x(p)], [v for p in mine for v in y(p)], "points",
                 COLOURS[i % len(COLOURS)], symbol=SYMBOLS[i % len(SYMBOLS)], size=size,
                 text=[p.file for p in mine for _ in x(p)]) for i, (name, mine) in enumerate(groups.items())]


def words(kind: str, mine: StandResult | FlightResult, rows: Sequence[ErrorRow]) -> list[str]:
    """The finding in a few sentences."""
    factor, unit, digits = UNITS[kind]
    best, chosen = mine.best, mine.chosen
    if best is None or chosen is None:
        return ["No map is a result: " + "; ".join(f"{in_words(n)}: {why}" for n, why in mine.no_result.items()) + "."]
    named = {(r.model, r.split): r for r in rows if r.clock == getattr(mine, "clock", "")}
    split = "test" if (best, "test") in named else "train"
    text = [f"Chosen: {in_words(best)}, by training files that were held out in turn "
            f"({factor * mine.held_out_rms[best]:.{digits}f} {unit})."]
    compared = [f"{in_words(name)} {factor * named[name, split].rms:.{digits}f}"
                for name in (best, "thrust_voltage", "thrust_pwm", "firmware_2_1_plus", "scaled_2_1_plus",
                             "scaled_2_1_plus_balanced", "firmware_legacy")
                if (name, split) in named]
    text.append(f"RMS on {'held-out' if split == 'test' else 'training'} files, {unit}: " + ", ".join(compared) + ".")
    if (best, split) in named and (covered := named[best, split].coverage95) is not None:
        text.append(f"The 95 % prediction interval (± {factor * chosen.interval_half_width:.{digits}f} {unit}) holds "
                    f"{100 * covered:.0f} % of these rows.")
    if pairs := mine.against_firmware:
        text.append(f"On {sum(p.beaten for p in pairs)} of {len(pairs)} held-out files the error is smaller than that "
                    "of the firmware's better curve. With it scaled to the training files: on "
                    f"{sum(p.scaled_beaten or False for p in pairs)}.")
    note = interval_note([row for row in rows if row.split == split])
    return [*text, note] if note else text


def _row(row: ErrorRow, factor: float, digits: int, best: str | None) -> dict[str, Any]:
    interval = "" if row.ci95 is None else " .. ".join(f"{factor * x:.{digits}f}" for x in row.ci95)
    return {"model": in_words(row.model), "best": row.model == best, "split": row.split, "clock": row.clock,
            "rms": f"{factor * row.rms:.{digits}f}", "interval": interval, "n": row.n,
            "files": row.files, "bias": f"{factor * row.bias:+.{digits}f}",
            "coverage": DASH if row.coverage95 is None else f"{100 * row.coverage95:.0f}",
            "status": row.status, "uses": row.uses}


def _parameter(name: str, found: Estimate) -> dict[str, str]:
    interval = f"{found.ci95[0]:.4g} .. {found.ci95[1]:.4g}" if found.ci95 else DASH
    return {"name": name, "value": f"{found.value:.5g}", "unit": found.unit, "interval": interval}


def _series(entry: Series) -> dict[str, str]:
    constants, resistance = entry.constants, entry.battery_resistance
    return {"file": entry.file, "rows": str(entry.rows), "still": str(entry.still),
            "zero": DASH if math.isnan(entry.zero_N) else f"{1e3 * entry.zero_N:.2f}",
            **{name: f"{constants[name].value:.3e}" if name in constants else DASH for name in ("k_f", "K_e")},
            "R": DASH if resistance is None or resistance.ci95 is None else
            f"{resistance.value:.3f} ({resistance.ci95[0]:.3f} .. {resistance.ci95[1]:.3f})"}


def _inverse(table: InverseTable) -> dict[str, Any]:
    return {"thrusts": [f"{1e3 * t:.0f}" for t in table.thrust_N],
            "rows": [{"voltage": f"{v:.2f}", "limit": f"{1e3 * limit:.0f}",
                      "pwm": [DASH if math.isnan(u) else f"{u:.3f}" for u in pwm]}
                     for v, limit, pwm in zip(table.voltage_V, table.limit_N, table.pwm, strict=True)]}

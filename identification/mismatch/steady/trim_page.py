"""Page of comparisons of trims: one verdict, or a gallery of folders. Drawn as SVG, so that it needs no library."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nanobench_tools.pages.environment import environment
from nanobench_tools.pages.report_page import template
from nanobench_tools.results.result import to_json
from nanobench_tools.results.result_files import write_bytes
from nanobench_tools.version import __version__

from .causes import CAUSES
from .weigh import NONE

WIDTH, HEIGHT, LEFT, BOTTOM = 360.0, 220.0, 44.0, 26.0
LEAST_RANGE = 10.0
"""Per cent the axis of the trims reaches at least."""
BREAK_S = 1.5
"""Seconds further apart than this are of two runs."""


def write_steady_page(cases: Mapping[str, Mapping[str, Any]], path: Path, synthetic: bool,
                      summary: Sequence[str] = (), table: tuple[Sequence[str], Sequence[Sequence[str]]] = ((), ()),
                      dose: Mapping[str, Any] | None = None) -> None:
    """cases {title: verdict of ``steady.compare``}; above them summary: sentences, table: heads and rows, one a case,
    dose {cut_mm, loss_percent}: of cut propellers."""
    drawn = [{"id": f"case-{k}", "title": title, "body": to_json(body), **_pictures(to_json(body))}
             for k, (title, body) in enumerate(cases.items())]
    text = environment().get_template("steady.html").render(
        label="SYNTHETIC" if synthetic else "", version=__version__, css=template("report.css"), cases=drawn,
        summary=summary, heads=table[0], rows=table[1], dose=_dose(dose),
        ids={title: f"case-{k}" for k, title in enumerate(cases)}, width=WIDTH, height=HEIGHT, left=LEFT, bottom=BOTTOM)
    write_bytes(Path(path), text.encode(errors="replace"))


def _dose(dose: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Thrust lost over the millimetres cut off both blades of a propeller."""
    if not dose or not dose["cut_mm"]:
        return None
    cut, loss = np.array(dose["cut_mm"], float), np.array(dose["loss_percent"], float)
    y = _scale(min(0.0, 1.1 * float(loss.min())), max(LEAST_RANGE, 1.1 * float(loss.max())))
    widest = 1.1 * max(float(cut.max()), 1.0)

    def x(mm: float) -> float:
        return LEFT + mm / widest * (WIDTH - LEFT)

    levels = [t for t in _ticks(max(LEAST_RANGE, 1.1 * float(loss.max()))) if t >= 0.0]
    return {"dots": [(x(c), y(v)) for c, v in zip(cut, loss, strict=True)], "levels": [(t, y(t)) for t in levels],
            "cuts": [(mm, x(mm)) for mm in range(0, int(widest) + 1, 1 if widest < 8.0 else 2)], "n": len(cut)}


def _pictures(body: Mapping[str, Any]) -> dict[str, Any]:
    trim = body.get("trim")
    return {"trim": None if trim is None else _trim(trim), "chances": None if trim is None else _chances(trim),
            "spectrum": _spectrum(body.get("swing") or {}), "proof": _proof(body.get("improvement")),
            "course": None if trim is None else _course(trim), "place": None if trim is None else _place(trim)}


def _trim(trim: Mapping[str, Any]) -> dict[str, Any]:
    """Commanded thrust of each motor: band and dots of the normal flights, dots and mean of the examined flights."""
    usual = np.array([f["change_percent"] for f in trim["normal_flights"]]).reshape(-1, 4)
    here = np.array([f["change_percent"] for f in trim["flights"]])
    most = max(LEAST_RANGE, 1.1 * float(np.abs(np.concatenate([usual, here])).max()))
    y = _scale(-most, most)
    column = (WIDTH - LEFT) / 4.0
    centre = [LEFT + column * (k + 0.5) for k in range(4)]
    band = 2.0 * trim["normal_sd_percent"]
    return {"ticks": [(t, y(t)) for t in _ticks(most)], "zero": y(0.0), "band": (y(band), y(-band) - y(band)),
            "motors": list(zip(trim["motors"], centre, strict=True)),
            "usual": [(centre[k] - 0.22 * column, y(v)) for row in usual for k, v in enumerate(row)],
            "here": [(centre[k] + 0.08 * column, y(v)) for row in here for k, v in enumerate(row)],
            "mean": [(centre[k] - 0.05 * column, centre[k] + 0.3 * column, y(v))
                     for k, v in enumerate(trim["change_percent"])]}


def _course(trim: Mapping[str, Any]) -> dict[str, Any] | None:
    """Each motor's change second by second, flights one after the other upon the same seconds."""
    rows = [np.array(f["course"], float) for f in trim["flights"] if f.get("course")]
    if not rows:
        return None
    longest = max(float(r[-1, 0]) for r in rows) or 1.0
    most = max(LEAST_RANGE, 1.1 * float(np.abs(np.concatenate(rows)[:, 3:]).max()))
    y = _scale(-most, most)

    def x(t: float) -> float:
        return LEFT + t / longest * (WIDTH - LEFT - 20.0)

    runs = [run for flight in rows for run in np.split(flight, np.flatnonzero(np.diff(flight[:, 0]) > BREAK_S) + 1)]
    lines = [(f"motor-{k + 1}", " ".join(f"{x(r[0]):.1f},{y(r[3 + k]):.1f}" for r in run))
             for run in runs for k in range(4)]
    return {"lines": lines, "ticks": [(t, y(t)) for t in _ticks(most)], "seconds": [(t, x(t)) for t in _ticks(longest)
                                                                                 if t >= 0.0]}


def _place(trim: Mapping[str, Any]) -> dict[str, Any] | None:
    """Map of the room with the change of the motor that changed most: one dot a second, by size and sign."""
    rows = [np.array(f["course"], float) for f in trim["flights"] if f.get("course")]
    if not rows or not np.isfinite(np.concatenate(rows)[:, 1:3]).any():
        return None
    every = np.concatenate(rows)
    every = every[np.isfinite(every[:, 1:3]).all(axis=1)]
    motor = int(np.argmax(np.abs(trim["change_percent"])))
    middle = 0.5 * (every[:, 1:3].max(axis=0) + every[:, 1:3].min(axis=0))
    half = max(0.6 * float(np.ptp(every[:, 1:3], axis=0).max()), 0.25)
    scale = (HEIGHT - BOTTOM - 16.0) / (2.0 * half)
    change = every[:, 3 + motor]
    most = max(LEAST_RANGE, float(np.abs(change).max()))
    centre = LEFT + 0.5 * (WIDTH - LEFT), 8.0 + 0.5 * (HEIGHT - BOTTOM)
    dots = [(centre[0] + scale * (x - middle[0]), centre[1] - scale * (y - middle[1]),
             2.0 + 6.0 * abs(c) / most, "here" if c > 0.0 else "less")
            for (x, y), c in zip(every[:, 1:3], change, strict=True)]
    return {"motor": motor + 1, "dots": dots, "bar": (LEFT, LEFT + scale * 0.25),
            "spread": float(np.std(change)), "mean": float(np.mean(change))}


def _chances(trim: Mapping[str, Any]) -> list[tuple[str, float, str]]:
    """(cause, width of its bar, per cent), the likeliest five."""
    named = {**{name: cause.short for name, cause in CAUSES.items()}, NONE: "no change"}
    best = sorted(trim["probability"].items(), key=lambda item: -item[1])[:5]
    return [(named[name], 200.0 * p, _percent(p)) for name, p in best]


def _percent(p: float) -> str:
    return "< 1 %" if p < 0.01 else "> 99 %" if p > 0.99 else f"{100.0 * p:.0f} %"


def _spectrum(swing: Mapping[str, Any]) -> dict[str, Any] | None:
    """Horizontal force that the tilt does not explain, by frequency."""
    if not swing.get("here") or not swing.get("normal"):
        return None
    f = np.array(swing["frequency_hz"])
    most = max(3.0, 1.1 * max(*swing["here"], *swing["normal"]))
    y = _scale(0.0, most)
    x = LEFT + (f - f[0]) / (f[-1] - f[0]) * (WIDTH - LEFT - 8.0)

    def line(values: Sequence[float]) -> str:
        return " ".join(f"{a:.1f},{y(v):.1f}" for a, v in zip(x, values, strict=True))

    found = swing.get("found")
    at = None if not found else (float(np.interp(found["frequency_hz"], f, x)), f"{found['frequency_hz']:.2f} Hz")
    return {"here": line(swing["here"]), "normal": line(swing["normal"]), "found": at,
            "ticks": [(f"{t:.1f}", float(np.interp(t, f, x))) for t in (0.4, 0.8, 1.2)],
            "levels": [(t, y(t)) for t in _ticks(most)]}


def _proof(improvement: Mapping[str, Any] | None) -> list[tuple[str, float, str]] | None:
    """(words, width of a bar, per cent) before, after and the spread of normal flights."""
    if not improvement:
        return None
    entry = improvement["trim"]
    most = max(entry["before"], entry["after"], entry["floor"])
    return [(words, 200.0 * entry[key] / most, f"{entry[key]:.1f} %") for words, key in (
        ("from normal flights", "before"), ("with what was named", "after"), ("a normal flight", "floor"))]


def _scale(low: float, high: float) -> Callable[[float], float]:
    return lambda v: 8.0 + (high - v) / (high - low) * (HEIGHT - BOTTOM - 8.0)


def _ticks(most: float) -> list[float]:
    step = next(s for s in (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 1e6) if most / s <= 4.0)
    return [step * k for k in range(-int(most / step), int(most / step) + 1)]

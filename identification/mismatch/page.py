"""report.html: a diagnosis on one page that works without a network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from nanobench_tools.flight import Fault
from nanobench_tools.pages.environment import environment
from nanobench_tools.pages.packed import compressed
from nanobench_tools.pages.plotly_json import spec
from nanobench_tools.pages.report_page import (
    FIGURE_SCRIPTS,
    breakable,
    library,
    made_on,
    recordings_of,
    template,
)
from nanobench_tools.physics.model import find_term
from nanobench_tools.results.result import to_json
from nanobench_tools.results.result_files import write_bytes
from nanobench_tools.tables.quantities import DASH
from nanobench_tools.version import __version__

from .drawings import drawings
from .pictures import pictures
from .proof import HORIZONS, QUANTITIES
from .recordings import Recordings
from .track import ROW_S
from .verdict import Verdict
from .wrench import CHANNELS

OUTCOMES = {"named": "Named", "unknown": "Unknown", "none": "No mismatch", "data_fault": "The data are at fault",
            "insufficient": "Too little to say"}
SECTIONS = (("verdict", "Verdict"), ("data", "Data first"), ("residual", "Residual"), ("locate", "Locate"),
            ("name", "Name"), ("model", "Model"), ("prove", "Prove"))
QUANTITY_UNITS = {"position_m": ("Position", "m"), "velocity_m_s": ("Velocity", "m/s"),
                  "attitude_rad": ("Attitude", "rad"), "rate_rad_s": ("Rate", "rad/s")}


@dataclass(frozen=True)
class Table:
    """title; heads (text, unit, whether the column has numbers); rows of cells, the first identifies the row."""

    title: str
    heads: tuple[tuple[str, str, bool], ...]
    rows: Sequence[Sequence[str]]


def write_page(verdict: Verdict, recordings: Recordings, path: Path, synthetic: bool) -> None:
    """Write the page of a verdict, even if no row was judged. ``synthetic``: every caption states it."""
    write_bytes(Path(path), page_text(verdict, recordings, synthetic).encode(errors="replace"))


def page_text(verdict: Verdict, recordings: Recordings, synthetic: bool) -> str:
    """The page as text."""
    body, drawn = to_json(verdict.to_json()), to_json(pictures(verdict, recordings))
    held_out = bool((body.get("improvement") or {}).get("held_out"))
    real = "" if synthetic else ", real"  # SYNTHETIC precedes every caption
    n = f"n = {_flights(len({t.flight for t in recordings.tracks}))}, {recordings.judged_s:.0f} s{real}"
    recorded = f"n = {_flights(len(recordings.flights))}{real}"
    figures = drawings(drawn, [(h, f"{1e3 * h * ROW_S:.0f} ms") for h in HORIZONS], n, recorded)
    return environment(breakable=breakable, dash=DASH).get_template("mismatch.html").render(
        label="SYNTHETIC" if synthetic else "", version=__version__, library=library(), css=template("report.css"),
        title=recordings_of(recordings.names, [f.provenance.path for f in recordings.flights]) or "no recordings",
        made=made_on({"diagnose": body}), scripts=[template(name) for name in FIGURE_SCRIPTS],
        sections=SECTIONS, outcome=OUTCOMES[body["outcome"]],
        body=body, figures=figures, judged=verdict.left is not None, torques=bool(drawn.get("rms", {}).get(
            "samples", [0] * 6)[3]), named=bool(body["findings"]), held_out=held_out,
        n=n, recorded=recorded, left_out=[], failed=[], tables=tables(verdict, body, drawn, recordings),
        data=compressed({name: spec(figure) for name, figure in figures.items()}))


def _flights(n: int) -> str:
    return f"{n} flight{'s' * (n != 1)}"


def tables(verdict: Verdict, body: Mapping[str, Any], drawn: Mapping[str, Any],
           recordings: Recordings) -> dict[str, Table]:
    """Every table by name, without empty ones."""
    found = {"findings": findings(body), "faults": faults(verdict, recordings), "spans": judged(recordings),
             "left_out": left_out(recordings), "rejected": reasons(
                 [*(body.get("not_named") or []), *(body.get("not_asked") or [])], "Not identified"),
             "withdrawn": reasons(body.get("withdrawn") or [], "Identified, then rejected"),
             "parameters": parameters(body), "by_flight": own_values(body),
             "levels": levels(body), "improvement": improvement(body), "power": power(body),
             "discrepancy": discrepancy(body)}
    if "rms" in drawn:
        found["rms"] = rms(drawn["rms"], bool(body["findings"]))
    return {name: table for name, table in found.items() if table.rows}


def findings(body: Mapping[str, Any]) -> Table:
    rows = [(entry["term"], find_term(entry["term"]).sentence, ";\n".join(
        f"{name.partition('.')[2]} {p['value']:.4g} ({p['ci95'][0]:.4g} .. {p['ci95'][1]:.4g})"
        + f" {p['unit']}" * (p["unit"] != "1")
        for name, p in entry["parameters"].items()), f"{100 * entry['confidence']:.0f}",
             DASH if entry["residual_share"] is None else f"{100 * entry['residual_share']:.0f}",
             f"{', '.join(entry['where']['axes'])} ({entry['where']['frame']})",
             entry["where"]["covariate"] or DASH, _where(entry["where"]),
             ", ".join(entry["equivalent"]) or "no other effect", entry["settle_with"] or DASH)
            for entry in body["findings"]]
    return Table("What the simulator leaves out",
                 (("Effect", "", False), ("What it is", "", False), ("From the flights (95 %)", "", False),
                  ("Confidence", "%", True), ("Share", "%", True), ("Shows in (frame)", "", False),
                  ("Goes with", "", False), ("Flights", "", False), ("Indistinguishable from", "", False),
                  ("How to distinguish them", "", False)), rows)


def _where(where: Mapping[str, Any]) -> str:
    return "all" if where["regime"] == "all" else f"{where['regime']}: {', '.join(where['flights'])}"


def faults(verdict: Verdict, recordings: Recordings) -> Table:
    """Faults grouped by kind, with the number that touch the judged rows."""
    groups: dict[str, list[tuple[str, Fault]]] = {}
    for name, fault in recordings.faults:
        groups.setdefault(fault.kind, []).append((name, fault))
    touching = recordings.touching if verdict.left is not None else ()
    rows = []
    for kind, entries in sorted(groups.items()):
        streams = sorted({f.stream or "all" for _, f in entries})
        name, worst = max(entries, key=lambda e: abs(e[1].size) if np.isfinite(e[1].size) else 0.0)
        size = f"{worst.size:.3g} {worst.unit}" if np.isfinite(worst.size) else DASH
        rows.append((kind, ", ".join(streams), str(len(entries)),
                     f"{len({n for n, _ in entries})} of {len(recordings.flights)}",
                     str(sum(f.kind == kind for _, f in touching)) if verdict.left is not None else DASH, size,
                     f"{name}: {worst.evidence}"))
    return Table("Faults of the data",
                 (("Fault", "", False), ("Streams", "", False), ("Times", "", True), ("Flights", "", True),
                  ("Matter", "", True), ("Largest", "", True), ("The largest, in words", "", False)), rows)


def judged(recordings: Recordings) -> Table:
    rows = []
    for number, flight in enumerate(recordings.flights):
        audit = recordings.audits.get(flight.name)
        mine = [t for t in recordings.tracks if t.flight == number]
        seconds = ROW_S * sum(int(np.sum(t.counts)) for t in mine)
        air = sum(s.duration_s for s in audit.airborne) if audit else float("nan")
        rows.append((flight.name, f"{air:.1f}" if np.isfinite(air) else DASH, f"{seconds:.1f}", str(len(mine))))
    return Table("What was judged", (("Flight", "", False), ("In the air", "s", True), ("Judged", "s", True),
                                     ("Spans", "", True)), rows)


def left_out(recordings: Recordings) -> Table:
    return Table("Left out", (("Flight", "", False), ("Why", "", False)), list(recordings.left_out.items()))


def rms(drawn: Mapping[str, Any], named: bool) -> Table:
    sides = [("Simulator as given", "before"), *([("Corrected", "after")] if named else []),
             ("A right simulator leaves", "floor")]
    rows = [(name, "m/s²" if c < 3 else "rad/s²", *(f"{drawn[key][c]:.3g}" for _, key in sides),
             str(drawn["samples"][c])) for c, name in enumerate(CHANNELS) if drawn["samples"][c]]
    return Table("RMS of the residual by channel, body frame",
                 (("Channel", "", False), ("Unit", "", False), *((text, "", True) for text, _ in sides),
                  ("Samples", "", True)), rows)


def reasons(entries: Sequence[Mapping[str, str]], title: str) -> Table:
    return Table(title, (("Effect", "", False), ("Why not", "", False)), [(e["term"], e["why"]) for e in entries])


def parameters(body: Mapping[str, Any]) -> Table:
    rows = [(name, f"{p['believed']:.5g}", f"{p['value']:.5g}", f"{p['ci95'][0]:.4g} .. {p['ci95'][1]:.4g}", p["unit"])
            for entry in body["findings"] for name, p in entry["parameters"].items()]
    return Table("Parameters of the corrected simulator",
                 (("Parameter", "", False), ("Simulator", "", True), ("From the flights", "", True), ("95 %", "", True),
                  ("Unit", "", False)), rows)


def own_values(body: Mapping[str, Any]) -> Table:
    """Values of terms that differ between flights."""
    rows = [(name, flight, f"{value:.5g}", entry["parameters"][name]["unit"] if name in entry["parameters"] else "")
            for entry in body["findings"] for name, values in (entry.get("by_flight") or {}).items()
            for flight, value in values.items()]
    return Table("Parameters that differ between flights",
                 (("Parameter", "", False), ("Flight", "", False), ("Value", "", True), ("Unit", "", False)), rows)


def levels(body: Mapping[str, Any]) -> Table:
    """Table of the per-flight offsets, which add to the shared values."""
    found = body.get("levels") or {}
    flights = next(iter(found.values()))["by_flight"] if found else {}
    rows = [(flight, *(f"{entry['by_flight'][flight]:+.3g}" for entry in found.values())) for flight in flights]
    rows += [("standard deviation", *(f"{entry['sd']:.3g}" for entry in found.values()))] if found else []
    return Table("Per-flight offsets", (("Flight", "", False),
                                           *((name, entry["unit"], True) for name, entry in found.items())), rows)


GOES_WITH = {"tilt": "tilt of the markers, of each flight", "lift": "thrust, of each flight",
             "roll_trim": "roll moment at rest, of each flight", "pitch_trim": "pitch moment at rest, of each flight",
             "yaw_trim": "yaw moment at rest, of each flight",
             "place": "force by place", "air": "force by air velocity", "thrust": "force by thrust",
             "lean": "force by direction of lean", "time": "force by time alone",
             "late": "force by thrust of the seconds before", "strained": "force that only resembles an effect",
             "force": "these forces together, which may oppose each other",
             "turn_place": "roll and pitch moments by place", "turn_air": "roll and pitch moments by air velocity",
             "turn_thrust": "roll and pitch moments by thrust", "turn_late": "moments by thrust of the seconds before",
             "yaw_place": "yaw moment by place", "yaw_air": "yaw moment by air velocity",
             "yaw_thrust": "yaw moment by thrust"}
"""Of ``discrepancy_m_s2``: group -> words."""


SHOWN_M_S2 = 0.0005
"""Less would be shown as 0."""


def discrepancy(body: Mapping[str, Any]) -> Table:
    """Table of the unexplained part, as an acceleration (moments by the arms of the rotors)."""
    found = body.get("discrepancy_m_s2") or {}
    rows = [(GOES_WITH.get(group, group), f"{size:.3f}") for group, size in sorted(found.items(), key=lambda e: -e[1])
            if size >= SHOWN_M_S2]
    return Table("What no effect explains", (("Goes with", "", False), ("RMS", "m/s²", True)), rows)


def improvement(body: Mapping[str, Any]) -> Table:
    """Mean errors of prediction at every horizon, before and after."""
    found = body["improvement"] or {}
    named = bool(body["findings"])
    rows = []
    for h in HORIZONS:
        entry = found.get(str(h))
        if entry is None:
            continue
        cells = [_change(entry["before"][q], entry["after"][q], named) for q in QUANTITIES]
        between = entry["relative_ci95"]
        gained = DASH if not between else f"{100 * between[0]:.0f} .. {100 * between[1]:.0f}"
        rows.append((f"{h}: {1e3 * h * ROW_S:.0f} ms", *cells, gained))
        if entry.get("floor"):
            rows.append(("noise alone", *(_change(entry["floor"][q], None, False) for q in QUANTITIES), DASH))
    return Table("Mean error of prediction" + (", before → after" if named else ""),
                 (("Steps ahead", "", False), *((*QUANTITY_UNITS[q], True) for q in QUANTITIES),
                  ("Less error, 95 %", "%", True)), rows)


def _change(before: float | None, after: float | None, named: bool) -> str:
    texts = [DASH if x is None else f"{x:.3g}" for x in ((before, after) if named else (before,))]
    return " → ".join(texts)


def power(body: Mapping[str, Any]) -> Table:
    rows = [(term, (entry.get("parameter") or DASH).removeprefix(f"{term}."),
             "not detectable" if entry["minimum_detectable"] is None else f"{entry['minimum_detectable']:.3g}",
             entry["unit"]) for term, entry in sorted(body["power"].items())]
    return Table("Smallest change that would have been identified in these flights",
                 (("Effect", "", False), ("Parameter", "", False), ("Least change", "", True),
                  ("Unit", "", False)), rows)

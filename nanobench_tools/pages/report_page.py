"""report.html: one file that holds everything and asks the network for nothing."""

import functools
import re
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import quote

from markupsafe import Markup, escape

from ..auditing.audit_verdict import entry_of
from ..auditing.recording_audit import Audit
from ..flight import Flight
from ..tables.quantities import DASH, number
from ..tables.result_table import Column, Score, Table, score_text, write_tables
from ..version import __version__
from . import control_pictures, estimate_figures, overview_pictures, recording, words
from .audit_entry import total
from .clock_error import clock_error, typical
from .environment import environment
from .figure import Drawing, Figure
from .packed import compressed
from .plotly_json import spec
from .result_tables import tables_of
from .row_cells import AS_RECORDED, clock_of
from .task3_tables import logged_method
from .tiles import tiles

_TITLE = re.compile(r"<title>(.*?)</title>", re.DOTALL)
RESULTS = ("audit", "estimate", "sysid", "thrust", "control", "verdict")
"""Result files the page is made from, ``<name>.json``."""
SCRIPTS = ("chart.js", "tables.js", "page.js")
NAMED_FOLDERS = 2
"""The title names this many folders of recordings."""
FIGURE_SCRIPTS = ("chart.js", "tables.js", "figures.js")
"""Of the pages that draw all they have: ``data`` holds the figures."""


@dataclass(frozen=True)
class Section:
    """One part of the page: question, answer in words, pictures by name, tables. ``folded``: tables that open at a
    tap. An empty one is not shown."""

    id: str
    title: str
    subtitle: str
    words: words.Words
    figures: Mapping[str, Drawing]
    tables: Sequence[Table] = ()
    folded: Sequence[Table] = ()

    @property
    def empty(self) -> bool:
        return not (self.words or self.figures or self.tables or self.folded)


def write_report(out_dir: Path, results: Mapping[str, Mapping[str, Any]], flights: Iterable[Flight],
                 audits: Mapping[str, Audit], synthetic: bool) -> Path:
    """Writes report.html and the tables (CSV, LaTeX) into ``out_dir`` and returns the path of the page. Never
    overwrites the page of another verb (``page_path``).

    ``results`` has the contents of the result files by name. Names: ``audit``, ``estimate``, ``sysid``, ``control``,
    ``thrust``, ``verdict``. Absent files are skipped. A flight without an audit in ``audits`` takes the entry of
    ``results["audit"]`` with its name, or else its content hash. ``synthetic``: the page, every table and every
    picture say so, and only then.
    """
    from ..results.result_files import write_bytes

    out_dir = Path(out_dir)
    flights = list(flights)
    entries = {f["flight"]: f for f in (results.get("audit") or {}).get("flights") or []}
    by_name = {audit.flight: audit for audit in audits.values()}
    entries = {**{flight.name: entry_of(flight, by_name[flight.name]) for flight in flights
                  if flight.name in by_name and flight.name not in entries}, **entries}
    by_content = {entry["sha256"]: entry for entry in entries.values()}
    if "audit" not in results and entries:
        results = {**results, "audit": {"flights": list(entries.values()), "copies": []}}
    label = "SYNTHETIC" if synthetic else ""
    if synthetic:
        results = {name: without_published(body) for name, body in results.items()}
    tables = tables_of(results, synthetic)
    write_tables(out_dir, tables, label)
    taken_out = ((results.get("estimate") or {}).get("clocks") or {}).get("retimed") or {}
    entry = {flight.name: entries.get(flight.name) or by_content.get(flight.provenance.sha256) for flight in flights}
    views = [recording.view(flight, entry[flight.name], taken_out.get(flight.name)) for flight in flights]
    chosen = typical({name: e for name, e in entry.items() if e}, taken_out)
    wander = next((clock_error(f, entry[f.name] or {}, taken_out[f.name]) for f in flights if f.name == chosen), None)
    path = page_path(out_dir)
    write_bytes(path, render(results, tables, views, wander, label).encode(errors="replace"))
    return path


def page_path(out_dir: Path) -> Path:
    """report.html, or overview.html where report.html is another page, such as that of ``diagnose``."""
    path = out_dir / "report.html"
    if not path.is_file():
        return path
    title = _TITLE.search(path.read_text(encoding="utf-8", errors="replace")[:8000])
    return path if title is not None and title[1].strip().endswith("nanobench report") else out_dir / "overview.html"


def render(results: Mapping[str, Mapping[str, Any]], tables: Sequence[Table], views: Sequence[Mapping[str, Any]],
           wander: Figure | None, label: str) -> str:
    """The page as text. ``label`` precedes every caption, empty for real recordings."""
    parts = [part for part in sections(results, tables, wander) if not part.empty]
    first = overview_pictures.flights(results.get("audit"))
    drawings = {name: drawing for part in parts for name, drawing in part.figures.items()}
    if first is not None:
        drawings["usable"] = first
    return environment(view=table_view, breakable=breakable, dash=DASH).get_template("report.html").render(
        label=label, title=title_of(results), made=made_on(results), version=__version__,
        library=library(), css=template("report.css"),
        scripts=[template(name) for name in SCRIPTS], tiles=tiles(results), first=first, sections=parts,
        rows=flight_rows(results, {v["name"] for v in views}), views=[compressed(v) for v in views],
        names=[v["name"] for v in views], default=default_view(views),
        drawings=compressed({name: spec(drawing) for name, drawing in drawings.items()}),
        drawn=drawings, about=words.overview(results), failed=failures(results), manifest=manifest_lines(results))


def sections(results: Mapping[str, Mapping[str, Any]], tables: Sequence[Table],
             wander: Figure | None) -> list[Section]:
    """The questions of the page in their order."""
    estimate, control, sysid, audit, verdict = (results.get(name) for name in
                                                ("estimate", "control", "sysid", "audit", "verdict"))
    theirs = words.is_published(results)
    mine = {table.name: (table.without_published() if theirs else table).for_readers() for table in tables}

    def of(stem: str, *names: str) -> dict[str, Any]:
        found = [table for name, table in mine.items() if name.startswith(stem) and table.rows]
        return {"tables": [t for t in found if t.name in names], "folded": [t for t in found if t.name not in names]}

    return [
        Section("where", "Where was it?", "State estimation against motion capture", words.task3(results), drawn(
            wander=wander, progress=overview_pictures.progress(estimate),
            blackout=overview_pictures.blackout(estimate), **estimate_figures.pictures(estimate)),
            **of("table_task3", "table_task3_clocks")),
        Section("control", "How well was it flown, and how would another controller fly?", "Tracking, and the plant",
                words.task2(results), drawn(**control_pictures.pictures(control)), **of("table_task2", "table_task2")),
        Section("physics", "Which physics does it obey?", "Prediction over half a second", words.task1(results), drawn(
            task1=overview_pictures.task1(sysid, False)),
            **joined(of("table_task1", "table_task1"), of("table_thrust"))),
        Section("mismatch", "Where is the simulator wrong?", "Simulation against these flights",
                words.mismatch(verdict), {}),
        Section("clocks", "How late are the timestamps?", "Clocks against motion capture", [], drawn(
            clocks=overview_pictures.clocks(audit))),
        *([Section("published", "The published tables, and the same recordings corrected",
                   "Only shown where recordings of these tables are among yours", words.published(results), drawn(
                       speed=overview_pictures.by_speed(estimate), deadlogs=estimate_figures.dead_logs(estimate or {}),
                       published=overview_pictures.task1(sysid, True)),
                   folded=[t for table in tables if (t := table.published().for_readers()).rows])] if theirs else [])]


def title_of(results: Mapping[str, Mapping[str, Any]]) -> str:
    """Name the data: the folder of the recordings, or the one recording."""
    flights = (results.get("audit") or {}).get("flights") or []
    return recordings_of([str(f["flight"]) for f in flights],
                         [str(f["path"]) for f in flights if f.get("path")]) or "nanobench report"


def recordings_of(names: Sequence[str], paths: Sequence[str]) -> str:
    """The one recording, or how many of which folders; empty without any."""
    if len(names) == 1:
        return names[0]
    folders = list(dict.fromkeys(folder for path in paths if (folder := Path(path).parent.name)))
    more = " and others" if len(folders) > NAMED_FOLDERS else ""
    where = f" of {', '.join(folders[:NAMED_FOLDERS])}{more}" if folders else ""
    return f"{len(names)} recordings{where}" if names else ""


def made_on(results: Mapping[str, Mapping[str, Any]]) -> str:
    """The day on which the results were computed, empty where no manifest says it."""
    return next((str(body["manifest"]["started"])[:10] for body in results.values()
                 if (body.get("manifest") or {}).get("started")), "")


def drawn(**figures: Drawing | None) -> dict[str, Drawing]:
    """Those that there are."""
    return {name: figure for name, figure in figures.items() if figure is not None}


def joined(first: Mapping[str, list[Table]], second: Mapping[str, list[Table]]) -> dict[str, list[Table]]:
    return {key: [*first[key], *second[key]] for key in first}


def flight_rows(results: Mapping[str, Mapping[str, Any]], there: Container[str]) -> list[dict[str, Any]]:
    """What the list of flights says of each: verdict, advice, usable seconds, position error [mm] on two clocks."""
    errors: dict[tuple[str, str], float] = {}
    estimate = results.get("estimate") or {}
    method = logged_method(estimate.get("rows") or [])
    for item in estimate.get("per_flight") or []:
        value = number((item.get("metrics") or {}).get("ate_rmse_m"))
        if (item.get("protocol"), str(item.get("method"))) == ("clean", method) and value is not None:
            errors[str(item["flight"]), clock_of(item)] = 1e3 * value
    return [{"name": f["flight"], "link": quote(str(f["flight"]).encode(errors="replace")),
             "there": f["flight"] in there, "severity": f.get("severity") or "",
             "verdict": f.get("verdict") or "", "advice": f.get("advice") or "", "usable": total(f.get("usable")),
             "recorded": errors.get((f["flight"], AS_RECORDED)), "retimed": errors.get((f["flight"], "retimed"))}
            for f in (results.get("audit") or {}).get("flights") or []]


def without_published(body: Mapping[str, Any]) -> Mapping[str, Any]:
    """A result without the published table's values, for simulated flights: there is nothing to compare them with."""
    if "rows" not in body:
        return body
    return {**body, "rows": [{k: v for k, v in row.items() if k != "published"} for row in body["rows"]]}


def template(name: str) -> Markup:
    return Markup((files("nanobench_tools.pages") / "templates" / name).read_text(encoding="utf-8"))


@functools.cache
def library() -> str:
    """The plotting library, compressed: Plotly's basic bundle, with its licence."""
    return compressed((files("nanobench_tools.pages") / "vendor" / "plotly-basic.min.js").read_text(encoding="utf-8"))


def default_view(views: Sequence[Mapping[str, Any]]) -> int:
    """The recording shown first and in print: the one with most to draw, then the longest."""
    def richness(i: int) -> tuple[int, float, int]:
        figure = views[i]["figure"]
        return len(figure["panels"]), figure["cursor"][1] - figure["cursor"][0], -i

    return max(range(len(views)), key=richness, default=0)


def breakable(text: str) -> Markup:
    """Escaped text that may be broken after an underscore or a dot: names of recordings are long."""
    return Markup(re.sub(r"([_.])", r"\1<wbr>", str(escape(text))))


def table_view(table: Table) -> dict[str, Any]:
    """A table ready to be written: per cell its text, interval, sort key and mark of the reason when it is empty."""
    reasons: dict[str, str] = {}

    def cell(value: Any, column: Column) -> dict[str, Any]:
        if isinstance(value, Score):
            text, interval = score_text(value, column)
            mark = reasons.setdefault(value.reason, _letter(len(reasons))) if value.mean is None else ""
            return {"text": text, "interval": interval, "sort": value.mean, "number": True, "mark": mark,
                    "reason": value.reason if mark else ""}
        if column.kind == "count":
            text = DASH if value is None else str(value)
            return {"text": text, "interval": "", "sort": value, "number": True, "mark": "", "reason": ""}
        return {"text": value or "", "interval": "", "sort": value or "", "number": False, "mark": "", "reason": ""}

    rows = [[cell(v, c) for v, c in zip(row, table.columns, strict=True)] for row in table.rows]
    return {"rows": rows, "reasons": [(mark, reason) for reason, mark in reasons.items()]}


def _letter(i: int) -> str:
    """a, b, ..., z, aa, ab, ..."""
    return (_letter(i // 26 - 1) if i >= 26 else "") + chr(ord("a") + i % 26)


def failures(results: Mapping[str, Mapping[str, Any]]) -> list[dict[str, str]]:
    """What failed in any result file, each once."""
    seen: dict[tuple[str, str, str], dict[str, str]] = {}
    for body in results.values():
        for entry in body.get("failed") or []:
            line = {key: str(entry.get(key) or "") for key in ("item", "file", "error")}
            seen.setdefault((line["item"], line["file"], line["error"]), line)
    return list(seen.values())


def manifest_lines(results: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, str]]:
    """Label and value of what the results were made with, from the first manifest there is."""
    manifest: Mapping[str, Any] = next((b["manifest"] for b in results.values() if b.get("manifest")), {})
    versions = ", ".join(f"{name} {version}" for name, version in (manifest.get("versions") or {}).items())
    found = [("Command", " ".join(map(str, manifest.get("argv") or []))), ("Started", manifest.get("started")),
             ("Seed", manifest.get("seed")), ("Versions", versions), ("Python", manifest.get("python")),
             ("Platform", manifest.get("platform")), ("Source SHA-256", manifest.get("source_sha256")),
             ("Inputs", f"{len(manifest['inputs'])} files" if manifest.get("inputs") else None),
             ("Result files", ", ".join(f"{name}.json" for name in results))]
    return [(label, str(value)) for label, value in found if value not in (None, "")]

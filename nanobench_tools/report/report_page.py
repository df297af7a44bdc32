"""report.html: one file that holds everything and asks the network for nothing."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

from ..auditing import Audit
from ..flight import Flight
from ..version import __version__
from . import control_pictures, estimates, overview_pictures, words
from .clock_error import typical
from .environment import environment
from .quantities import DASH
from .recording import payload
from .result_tables import tables_of
from .tables import Column, Score, Table, score_text, write_tables

SECTIONS = (("overview", "Overview"), ("task1", "Task 1"), ("task2", "Task 2"), ("task3", "Task 3"),
            ("audit", "Data audit"), ("flights", "Flights"), ("manifest", "How this was made"))
SCRIPTS = ("draw.js", "clock.js", "control.js", "estimates.js", "overview.js", "flights.js", "page.js")
SUBTITLES = {"task1": "Which physics does it obey?", "task2": "How well was it flown?", "task3": "Where was it really?"}


def write_report(out_dir: Path, results: Mapping[str, Mapping[str, Any]], flights: Iterable[Flight],
                 audits: Mapping[str, Audit], synthetic: bool) -> Path:
    """Writes report.html and the tables (CSV, LaTeX) into ``out_dir`` and returns the path of the page.

    ``results`` are the contents of the result files by verb (``audit``, ``estimate``, ``sysid``, ``control``, ...);
    any may be absent and its section says so. A flight without an audit in ``audits`` takes the entry of
    ``results["audit"]`` with its name, or else its content hash. ``synthetic``: the page, every table and every
    picture say so, and only then.
    """
    from ..result_files import write_bytes

    out_dir = Path(out_dir)
    entries = {f["flight"]: f for f in (results.get("audit") or {}).get("flights") or []}
    entries.update({audit.flight: audit.to_json() for audit in audits.values()})
    by_content = {entry["sha256"]: entry for entry in entries.values()}
    if "audit" not in results and entries:
        results = {**results, "audit": {"flights": list(entries.values()), "copies": []}}
    label = "SYNTHETIC" if synthetic else ""
    if synthetic:
        results = {name: without_published(body) for name, body in results.items()}
    tables = tables_of(results, synthetic)
    write_tables(out_dir, tables, label)
    taken_out = ((results.get("estimate") or {}).get("clocks") or {}).get("retimed") or {}
    recordings = [payload(flight, entries.get(flight.name) or by_content.get(flight.provenance.sha256),
                          taken_out.get(flight.name)) for flight in flights]
    path = out_dir / "report.html"
    write_bytes(path, render(results, tables, recordings, entries, label).encode(errors="replace"))
    return path


def render(results: Mapping[str, Mapping[str, Any]], tables: Sequence[Table], recordings: Sequence[Mapping[str, Any]],
           entries: Mapping[str, Mapping[str, Any]], label: str) -> str:
    """The page as text. ``label`` stands before every caption, empty for real recordings."""
    library = plotly_source()
    overview = {"task1": overview_pictures.task1(results.get("sysid")),
                "task3": overview_pictures.task3(results.get("estimate"), words.way(bool(label))),
                **control_pictures.pictures(results.get("control")),
                "blackout": overview_pictures.blackout(results.get("estimate")),
                **estimates.pictures(results.get("estimate")), "clocks": overview_pictures.clocks(results.get("audit")),
                "wander": shown_wander(results.get("estimate"), entries, [r["name"] for r in recordings])}
    return environment(view=table_view, breakable=breakable, dash=DASH).get_template("report.html").render(
        label=label, sections=SECTIONS, subtitles=SUBTITLES, version=__version__, library=library,
        css=_template("report.css"), scripts=[_template(name) for name in SCRIPTS],
        none_of_it=words.ABSENT, words={"overview": words.overview(results), "task1": words.task1(results),
               "task2": words.task2(results, bool(label)), "task3": words.task3(results, bool(label))},
        tables={section: [t.for_readers() for t in tables if t.name.startswith(stem)] for section, stem in
                (*((task, f"table_{task}") for task in ("task1", "task2", "task3", "thrust")),
                 ("audit", "audit_flights"))},
        overview_json=safe_json({"label": label, **overview}), pictures=overview,
        matrix=overview_pictures.fault_matrix(results.get("audit")), recordings=[safe_json(r) for r in recordings],
        names=[r["name"] for r in recordings], default=default_recording(recordings, entries),
        failed=failures(results), manifest=manifest_lines(results))


def shown_wander(estimate: Mapping[str, Any] | None, entries: Mapping[str, Mapping[str, Any]],
                 names: Sequence[str]) -> dict[str, Any]:
    """Which recording's clock error stands in the section of Task 3."""
    taken_out = ((estimate or {}).get("clocks") or {}).get("retimed") or {}
    name = typical({n: entries[n] for n in names if n in entries}, taken_out)
    if name is None:
        return {"absent": "No recording at hand has a clock error that was found without the estimated position."}
    return {"flight": name, "index": list(names).index(name)}


def without_published(body: Mapping[str, Any]) -> Mapping[str, Any]:
    """A result without the published table's values: beside simulated flights they would compare nothing."""
    if "rows" not in body:
        return body
    return {**body, "rows": [{k: v for k, v in row.items() if k != "published"} for row in body["rows"]]}


def _template(name: str) -> Markup:
    return Markup((files("nanobench_tools.report") / "templates" / name).read_text(encoding="utf-8"))


def plotly_source() -> Markup | None:
    """The plotting library as text, None when it is not installed (extra ``report``)."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError:
        return None
    return Markup(get_plotlyjs().replace("</script", r"<\/script"))


def safe_json(value: Any) -> Markup:
    """JSON that cannot end the script element it stands in: every <, > and & is escaped."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)


def default_recording(recordings: Sequence[Mapping[str, Any]], entries: Mapping[str, Mapping[str, Any]]) -> int:
    """The recording shown first and in print: the one with most to draw, then the longest in the air."""
    def richness(i: int) -> tuple[int, float, int]:
        recording = recordings[i]
        drawn = sum(len(recording[k].get("series", ())) for k in ("paths", "errors", "battery", "motors"))
        spans = entries.get(recording["name"], {}).get("airborne") or []
        return drawn, round(sum(b - a for a, b in spans), 1), -i

    return max(range(len(recordings)), key=richness, default=0)


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

"""thrust.html: the maps of ``nanobench thrust`` on one page that asks the network for nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..protocols.sessions import interval_note
from ..version import __version__
from .environment import environment
from .quantities import DASH
from .report_page import _template, breakable, failures, plotly_source, safe_json

SECTIONS = {"stand": "Thrust stand", "flight": "Flights"}
KEYS = {"stand": ("rms_N", 1e3, "mN per motor", 2), "flight": ("rms_m_s2", 1.0, "m/s²", 4)}


def thrust_page(body: Mapping[str, Any], synthetic: bool) -> str:
    """The page as text from the content of thrust.json (plain JSON values). ``synthetic``: every caption says so."""
    parts = [part(kind, body) for kind in SECTIONS if kind in body]
    return environment(breakable=breakable, dash=DASH).get_template("thrust.html").render(
        label="SYNTHETIC" if synthetic else "", version=__version__, parts=parts, library=plotly_source(),
        css=_template("report.css"), scripts=[_template("draw.js"), _template("thrust.js")],
        left_out=body.get("left_out") or [], failed=failures({"thrust": body}),
        data=safe_json({p["kind"]: p["pictures"] for p in parts}))


def part(kind: str, body: Mapping[str, Any]) -> dict[str, Any]:
    """What the page says and draws of one kind."""
    mine = body[kind]
    key, factor, unit, digits = KEYS[kind]
    rows = [*((mine.get("as_recorded") or {}).get("rows") or []), *(r for r in body["rows"] if r["kind"] == kind)]
    rows.sort(key=lambda r: r["split"] != "test")  # what was held out first
    return {"kind": kind, "title": SECTIONS[kind], "best": mine["best"], "split": mine["split"], "unit": unit,
            "words": words(kind, mine, rows), "rows": [_row(r, key, factor, digits, mine["best"]) for r in rows],
            "parameters": [_parameter(name, value) for name, value in
                           (mine["parameters"].get(mine["best"] or "") or {}).items()],
            "series": [_series(s) for s in mine.get("series") or []],
            "inverse": _inverse(mine.get("inverse")), "toml": mine.get("toml", ""),
            "firmware": mine.get("firmware", ""), "firmware_note": mine.get("firmware_note", ""),
            "terms_mN": None if mine.get("terms_rms_N") is None else f"{1e3 * mine['terms_rms_N']:.2f}",
            "pictures": pictures(kind, mine)}


def words(kind: str, mine: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """The finding in a few text."""
    key, factor, unit, digits = KEYS[kind]
    best = mine["best"]
    if best is None:
        return ["No map is a result: " + "; ".join(f"{n}: {why}" for n, why in mine["no_result"].items()) + "."]
    named = {(r["model"], r["split"]): r for r in rows if r.get("clock") == mine.get("clock")}
    split = "test" if (best, "test") in named else "train"
    text = [f"Chosen: {best}, by training files that were held out in turn "
            f"({factor * mine['held_out_rms'][best]:.{digits}f} {unit})."]
    compared = [f"{name.replace('_', ' ')} {factor * named[name, split][key]:.{digits}f}"
                for name in (best, "thrust_voltage", "thrust_pwm", "firmware_2_1_plus", "scaled_2_1_plus",
                             "scaled_2_1_plus_balanced", "firmware_legacy")
                if (name, split) in named]
    text.append(f"RMS on {'held-out' if split == 'test' else 'training'} files, {unit}: " + ", ".join(compared) + ".")
    covered = named.get((best, split), {}).get("coverage95")
    if covered is not None:
        text.append(f"The 95 % prediction interval (± {factor * mine['interval_half_width']:.{digits}f} {unit}) holds "
                    f"{100 * covered:.0f} % of these rows.")
    pairs = mine.get("against_firmware") or []
    if pairs:
        text.append(f"Smaller error than the closer of the firmware's two curves on {sum(p['beaten'] for p in pairs)} "
                    f"of {len(pairs)} held-out files, than the closer of these scaled as it is on "
                    f"{sum(p.get('scaled_beaten') or False for p in pairs)}.")
    note = interval_note([row for row in rows if row["split"] == split])
    return [*text, note] if note else text


def pictures(kind: str, mine: Mapping[str, Any]) -> dict[str, Any]:
    """Plain data for the page's script."""
    _, factor, unit, _ = KEYS[kind]
    return {"unit": unit, "factor": factor, "curves": mine.get("curves") or [], "points": mine.get("points") or [],
            "half_width": mine.get("interval_half_width"), "pairs": mine.get("against_firmware") or []}


def _row(row: Mapping[str, Any], key: str, factor: float, digits: int, best: str | None) -> dict[str, Any]:
    interval = "" if row["ci95"] is None else " .. ".join(f"{factor * x:.{digits}f}" for x in row["ci95"])
    return {"model": row["model"], "best": row["model"] == best, "split": row["split"], "clock": row.get("clock", ""),
            "sort": row[key], "rms": f"{factor * row[key]:.{digits}f}", "interval": interval, "n": row["n"],
            "files": row["files"], "bias": f"{factor * row['bias']:+.{digits}f}",
            "coverage": DASH if row["coverage95"] is None else f"{100 * row['coverage95']:.0f}",
            "status": row["status"], "uses": row["uses"]}


def _parameter(name: str, body: Mapping[str, Any]) -> dict[str, str]:
    interval = body.get("ci95")
    return {"name": name, "value": f"{body['value']:.5g}", "unit": body["unit"],
            "interval": f"{interval[0]:.4g} .. {interval[1]:.4g}" if interval else DASH}


def _series(entry: Mapping[str, Any]) -> dict[str, str]:
    constants = entry["constants"]
    resistance = entry["battery_resistance"]
    return {"file": entry["file"], "rows": str(entry["rows"]), "still": str(entry["still"]),
            "zero": DASH if entry["zero_N"] is None else f"{1e3 * entry['zero_N']:.2f}",
            "k_f": f"{constants['k_f']['value']:.3e}" if "k_f" in constants else DASH,
            "K_e": f"{constants['K_e']['value']:.3e}" if "K_e" in constants else DASH,
            "R": DASH if resistance is None else f"{resistance['value']:.3f} "
                                                 f"({resistance['ci95'][0]:.3f} .. {resistance['ci95'][1]:.3f})"}


def _inverse(table: Mapping[str, Any] | None) -> dict[str, Any] | None:
    if table is None:
        return None
    return {"thrusts": [f"{1e3 * t:.0f}" for t in table["thrust_N"]],
            "rows": [{"voltage": f"{v:.2f}", "limit": f"{1e3 * limit:.0f}",
                      "pwm": [DASH if u is None else f"{u:.3f}" for u in pwm]}
                     for v, limit, pwm in zip(table["voltage_V"], table["limit_N"], table["pwm"], strict=True)]}

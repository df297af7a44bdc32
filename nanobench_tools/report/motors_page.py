"""motors.html: what ``nanobench motors`` found, on one page that asks the network for nothing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..protocols.compare import verdict
from ..protocols.sessions import interval_note
from ..version import __version__
from .environment import environment
from .quantities import DASH
from .report_page import _template, breakable, failures, plotly_source, safe_json

METRICS = (("roll_pitch_rate_mae_rad_s", "Roll, pitch rate", "rad/s"), ("yaw_rate_mae_rad_s", "Yaw rate", "rad/s"),
           ("attitude_mae_rad", "Attitude", "rad"))


def motors_page(body: Mapping[str, Any], synthetic: bool) -> str:
    """The page as text from the content of motors.json (plain JSON values). ``synthetic``: every caption says so."""
    return environment(breakable=breakable, dash=DASH).get_template("motors.html").render(
        label="SYNTHETIC" if synthetic else "", version=__version__, library=plotly_source(),
        css=_template("report.css"), scripts=[_template("draw.js"), _template("motors.js")],
        words=words(body), lags=[_lag(r, body["lag"]["best"]) for r in body["lag"]["rows"]],
        flights=[_flight(f) for f in body["lag"]["flights"]], maps=_maps(body["speed"]), metrics=METRICS,
        rotation=[_rotation(r) for r in body["rows"]], parameters=_parameters(body),
        steps=[f"{1e3 * h * body['step_s']:.0f}" for h in (1, 10, 50)], left_out=body["left_out"],
        failed=failures({"motors": body}), data=safe_json(pictures(body)))


def words(body: Mapping[str, Any]) -> list[str]:
    """The findings in a few text."""
    both, ends = body["lag"]["fit"], body["lag"]["fit"]["ci95"]
    text = ["Rotors follow their command with a time constant of " + " and ".join(
        f"{1e3 * both[key]:.1f} ms {way}" + (f" ({1e3 * ends[key][0]:.1f} .. {1e3 * ends[key][1]:.1f})"
                                             if ends.get(key) else "")
        for way, key in (("up", "tau_up_s"), ("down", "tau_down_s"))) +
        f", after a delay of {1e3 * both['delay_s']:.1f} ms that is also that of the speed measurement."]
    force = body["force"]
    value, unit = (force["k_f"], "N s²/rad²") if force["k_f"] is not None else (force["k_f_per_kg"], "N s²/rad² per kg")
    text.append(f"Thrust is {value:.4g} {unit} times squared speed ({force['identified']}).")
    explained = {name: found["median"] for name, found in body["moments"]["explained"].items()}
    if explained["x"] is not None:
        text.append("Of the angular acceleration between 3 and 30 Hz, rotor speeds explain "
                         + ", ".join(f"{100 * v:.0f} % ({name})" for name, v in explained.items()) + ".")
    for gain in body["gains"]:
        if gain["metric"] == METRICS[0][0] and gain["h"] == 10 and gain["input"] in ("logged", "rpm"):
            what = {"logged": "PWM at every row of the log", "rpm": "measured rotor speed"}[gain["input"]]
            ends = gain["ci95"] and [1.0 - 0.01 * e for e in reversed(gain["ci95"])]
            text.append(f"Error of roll and pitch rates {1e4 * body['step_s']:.0f} ms ahead from {what}, against the "
                        f"radio stream's: {verdict(1.0 - 0.01 * gain['less_percent'], ends)}.")
    note = interval_note([{**body, "n": len(body["test"])}])
    return [*text, note] if note else text


def pictures(body: Mapping[str, Any]) -> dict[str, Any]:
    """Plain data for the page's script."""
    return {"step_s": body["step_s"], "example": body["lag"]["example"], "curves": body["speed"]["curves"],
            "rotation": [{"input": r["input"], "words": r["words"],
                          "roll_pitch": r["curves"]["roll_pitch_rate_mae_rad_s"],
                          "attitude": r["curves"]["attitude_mae_rad"]} for r in body["rows"]]}


def _lag(row: Mapping[str, Any], best: str) -> dict[str, Any]:
    return {"model": row["model"], "best": row["model"] == best, "trouble": row["trouble"],
            "interval": "" if row["ci95"] is None else " .. ".join(f"{x:.2f}" for x in row["ci95"]),
            "rms": DASH if row["rms_rad_s"] is None else f"{row['rms_rad_s']:.2f}",
            **{k: f"{1e3 * row[k]:.1f}" for k in ("tau_up_s", "tau_down_s", "delay_s")}}


def _flight(entry: Mapping[str, Any]) -> dict[str, str]:
    return {"flight": entry["flight"], "trouble": entry["trouble"],
            **{k: f"{1e3 * entry[k]:.1f}" for k in ("tau_up_s", "tau_down_s", "delay_s")}}


def _maps(part: Mapping[str, Any]) -> list[dict[str, Any]]:
    rows = sorted(part["rows"], key=lambda r: r["rms_rad_s"] if r["rms_rad_s"] is not None else 1e9)
    return [{"model": r["model"], "best": r["model"] == part["best"], "equation": r["equation"],
             "trouble": r["trouble"], "rms": DASH if r["rms_rad_s"] is None else f"{r['rms_rad_s']:.2f}"} for r in rows]


def _rotation(row: Mapping[str, Any]) -> dict[str, Any]:
    cells = []
    for metric, _, _ in METRICS:
        for h in ("1", "10", "50"):
            ends = row["ci95"][metric].get(h)
            cells.append({"value": f"{row['metrics'][metric][h]:.3f}",
                          "interval": f"{ends[0]:.3f} .. {ends[1]:.3f}" if ends else ""})
    return {"input": row["input"], "words": row["words"], "trouble": row["trouble"], "cells": cells}


def _parameters(body: Mapping[str, Any]) -> list[dict[str, str]]:
    fitted = body["moments"]["fitted"].get("logged") or {}
    found = [(name, entry) for name, entry in (fitted.get("parameters") or {}).items()]
    found += [(f"{body['speed']['best']}: {name}", entry) for name, entry in body["speed"]["parameters"].items()]
    return [{"name": name, "value": f"{entry['value']:.4g}", "unit": entry["unit"]} for name, entry in found]

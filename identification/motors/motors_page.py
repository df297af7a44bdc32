"""motors.html: what ``nanobench motors`` found, on one page that asks the network for nothing."""

from __future__ import annotations

import math
from typing import Any

from nanobench_tools.protocols.compare import verdict
from nanobench_tools.protocols.sessions import interval_note
from nanobench_tools.report.environment import environment
from nanobench_tools.report.quantities import DASH
from nanobench_tools.report.report_page import _template, breakable, plotly_source, safe_json
from nanobench_tools.result import to_json
from nanobench_tools.version import __version__

from .motor_parts import LagTimes, MotorResult, RotationRow

METRICS = (("roll_pitch_rate_mae_rad_s", "Roll, pitch rate", "rad/s"), ("yaw_rate_mae_rad_s", "Yaw rate", "rad/s"),
           ("attitude_mae_rad", "Attitude", "rad"))


def motors_page(found: MotorResult, synthetic: bool) -> str:
    """The page as text. ``synthetic``: every caption says so."""
    return environment(breakable=breakable, dash=DASH).get_template("motors.html").render(
        label="SYNTHETIC" if synthetic else "", version=__version__, library=plotly_source(),
        css=_template("report.css"), scripts=[_template("draw.js"), _template("motors.js")],
        words=words(found), lags=[{
            "model": r.model, "best": r.model == found.lag.best, "trouble": r.trouble, **_times(r.times),
            "interval": "" if r.ci95 is None else " .. ".join(f"{x:.2f}" for x in r.ci95), "rms": _rms(r.rms_rad_s)}
            for r in found.lag.rows],
        flights=[{"flight": f.flight, "trouble": f.trouble, **_times(f.times)} for f in found.lag.flights],
        maps=[{"model": r.model, "best": r.model == found.speed.best, "equation": r.equation, "trouble": r.trouble,
               "rms": _rms(r.rms_rad_s)} for r in found.speed.ranked],
        metrics=METRICS, rotation=[_rotation(r) for r in found.rows], parameters=_parameters(found),
        steps=[f"{1e3 * h * found.step_s:.0f}" for h in (1, 10, 50)], left_out=found.left_out, failed=[],
        data=safe_json(to_json({
            "step_s": found.step_s, "example": found.lag.example, "curves": found.speed.curves,
            "rotation": [{"input": r.input, "words": r.words, "roll_pitch": r.curves["roll_pitch_rate_mae_rad_s"],
                          "attitude": r.curves["attitude_mae_rad"]} for r in found.rows]})))


def words(found: MotorResult) -> list[str]:
    """The findings in a few sentences."""
    both, ends = found.lag.fit, found.lag.fit.ci95
    text = ["Rotors follow their command with a time constant of " + " and ".join(
        f"{1e3 * time_s:.1f} ms {way}" + (f" ({1e3 * ends[key][0]:.1f} .. {1e3 * ends[key][1]:.1f})"
                                          if ends.get(key) else "")
        for way, key, time_s in (("up", "tau_up_s", both.tau_up_s), ("down", "tau_down_s", both.tau_down_s))) +
        f", after a delay of {1e3 * both.delay_s:.1f} ms that is also that of the speed measurement."]
    force = found.force
    value, unit = (force.k_f, "N s²/rad²") if force.k_f is not None else (force.k_f_per_kg, "N s²/rad² per kg")
    text.append(f"Thrust is {value:.4g} {unit} times squared speed ({force.identified}).")
    explained = {name: share.median for name, share in found.moments.explained.items() if share.median is not None}
    if "x" in explained:
        text.append("Of the angular acceleration between 3 and 30 Hz, rotor speeds explain "
                    + ", ".join(f"{100 * v:.0f} % ({name})" for name, v in explained.items()) + ".")
    for gain in found.gains:
        if gain.metric == METRICS[0][0] and gain.h == 10 and gain.input in ("logged", "rpm"):
            what = {"logged": "PWM at every row of the log", "rpm": "measured rotor speed"}[gain.input]
            text.append(f"Error of roll and pitch rates {1e4 * found.step_s:.0f} ms ahead from {what}, against the "
                        f"radio stream's: {verdict(*gain.ratio)}.")
    note = interval_note([{"sessions": found.sessions, "ci_why": found.ci_why, "n": len(found.test)}])
    return [*text, note] if note else text


def _times(times: LagTimes) -> dict[str, str]:
    return {name: f"{1e3 * time_s:.1f}" for name, time_s in vars(times).items()}


def _rms(rms_rad_s: float) -> str:
    return DASH if math.isnan(rms_rad_s) else f"{rms_rad_s:.2f}"


def _rotation(row: RotationRow) -> dict[str, Any]:
    cells = []
    for metric, _, _ in METRICS:
        for h in ("1", "10", "50"):
            ends = row.ci95[metric].get(h)
            cells.append({"value": f"{row.metrics[metric][h]:.3f}",
                          "interval": f"{ends[0]:.3f} .. {ends[1]:.3f}" if ends else ""})
    return {"input": row.input, "words": row.words, "trouble": row.trouble, "cells": cells}


def _parameters(found: MotorResult) -> list[dict[str, str]]:
    logged = found.moments.fitted.get("logged")
    values = [*(logged.parameters.items() if logged else ()),
              *((f"{found.speed.best}: {name}", value) for name, value in found.speed.parameters.items())]
    return [{"name": name, "value": f"{value.value:.4g}", "unit": value.unit} for name, value in values]

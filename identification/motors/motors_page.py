"""motors.html: what ``nanobench motors`` found, on one page that asks the network for nothing."""

import math
from typing import Any

from nanobench_tools.pages.environment import environment
from nanobench_tools.pages.figure import Axis, Colour, Drawing, Figure, Mark, Panel, styled
from nanobench_tools.pages.packed import compressed
from nanobench_tools.pages.plotly_json import spec
from nanobench_tools.pages.report_page import FIGURE_SCRIPTS, breakable, library, template
from nanobench_tools.protocols.compare import verdict
from nanobench_tools.protocols.sessions import interval_note
from nanobench_tools.tables.quantities import DASH
from nanobench_tools.version import __version__

from .motor_parts import LagTimes, MotorResult, RotationRow

METRICS = (("roll_pitch_rate_mae_rad_s", "Roll, pitch rate", "rad/s"), ("yaw_rate_mae_rad_s", "Yaw rate", "rad/s"),
           ("attitude_mae_rad", "Attitude", "rad"))


def motors_page(found: MotorResult, synthetic: bool) -> str:
    """The page as text. ``synthetic``: every caption says so."""
    drawn = figures(found)
    return environment(breakable=breakable, dash=DASH).get_template("motors.html").render(
        label="SYNTHETIC" if synthetic else "", version=__version__, library=library(), figures=drawn,
        css=template("report.css"), scripts=[template(name) for name in FIGURE_SCRIPTS],
        words=words(found), lags=[{
            "model": r.model, "best": r.model == found.lag.best, "trouble": r.trouble, **_times(r.times),
            "interval": "" if r.ci95 is None else " .. ".join(f"{x:.2f}" for x in r.ci95), "rms": _rms(r.rms_rad_s)}
            for r in found.lag.rows],
        flights=[{"flight": f.flight, "trouble": f.trouble, **_times(f.times)} for f in found.lag.flights],
        maps=[{"model": r.model, "best": r.model == found.speed.best, "equation": r.equation, "trouble": r.trouble,
               "rms": _rms(r.rms_rad_s)} for r in found.speed.ranked],
        metrics=METRICS, rotation=[_rotation(r) for r in found.rows], parameters=_parameters(found),
        steps=[f"{1e3 * h * found.step_s:.0f}" for h in (1, 10, 50)], left_out=found.left_out, failed=[],
        data=compressed({name: spec(figure) for name, figure in drawn.items()}))


VOLTAGES: tuple[Colour, ...] = ("red", "green", "blue")


def figures(found: MotorResult) -> dict[str, Drawing]:
    """One second of a rotor, the map, and errors of prediction over the time ahead."""
    e = found.lag.example
    drawn: dict[str, Drawing] = {"example": Figure(
        "The second in which a rotor moves most", f"{e.flight}, motor {e.motor}. Held-out flights if there are any; "
        "simulated speeds have the mean of the measured one.",
        [Panel(Axis("time", "s"), Axis("rotor speed", "rad/s"), [
            Mark("measured", e.time_s, e.measured_rad_s, colour="orange"),
            *(Mark(name, e.time_s, y, colour=colour, dash=dash) for (name, y), colour, dash in zip(
                e.simulated_rad_s.items(), ("grey", "blue") * 4, ("dot", "dash") * 4, strict=False))],
            height=360, wide=True)])} if e is not None else {}
    if found.speed.curves:
        drawn["map"] = Figure(
            "The chosen map", "Mean of the four rotors, after the lag, over the PWM and voltages of the flights.",
            [Panel(Axis("PWM ratio", "1"), Axis("rotor speed", "rad/s"), [
                Mark(f"{c.voltage_V:g} V", c.pwm, c.speed_rad_s, colour=colour)
                for c, colour in zip(found.speed.curves, VOLTAGES, strict=False)], height=340, wide=True)])
    if found.rows:
        style = styled([row.input for row in found.rows], symbols=False)
        step_ms = 1e3 * found.step_s
        drawn["ahead"] = Figure("Error over the time ahead", "Mean over windows of the held-out flights.", [
            Panel(Axis("time ahead", "ms"), Axis(title, unit, zero=True), [
                Mark(row.input, [step_ms * (k + 1) for k in range(len(row.curves[key]))], row.curves[key],
                     **style[row.input])
                for row in found.rows], title, 360)
            for key, title, unit in (("roll_pitch_rate_mae_rad_s", "roll and pitch rate", "rad/s"),
                                     ("attitude_mae_rad", "attitude", "rad"))])
    return drawn


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

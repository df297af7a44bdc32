"""``nanobench motors``: motor lag, rotor speed, thrust and torque from logs with measured rotor speed."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import UsageError
from ..results.result import to_json
from ..steps.diagnosing import check_installed
from ..steps.motor_fits import FittedNumber, check_mass, fitted_numbers, motors_sentence, study_motors
from ..steps.options import Options, one_line
from ..steps.show import data_word, rich_table, say_reasons
from ..tables.result_table import Table as Grid
from .closing import again, close
from .shared_options import PATH, no_paths_beside, shared_options

if TYPE_CHECKING:
    from identification.motors import Study
    from identification.motors.motor_parts import ForcePart, LagPart, MomentPart, MotorResult, SpeedPart

SHOWN = (("roll_pitch_rate_mae_rad_s", "roll, pitch rate rad/s"), ("yaw_rate_mae_rad_s", "yaw rate rad/s"),
         ("attitude_mae_rad", "attitude rad"))


@click.command()
@shared_options("clock", "jobs", "scheduler")
@click.option("--train", multiple=True, type=PATH, metavar="PATH", help="Fit to these logs (with --test).")
@click.option("--test", multiple=True, type=PATH, metavar="PATH", help="Judge on these logs (with --train).")
@click.option("--mass", "mass_kg", type=float, metavar="KG",
              help="Mass of the vehicle with battery, for k_f; without it only k_f / m is identified.")
def motors(options: Options, train: tuple[Path, ...], test: tuple[Path, ...], mass_kg: float | None) -> int:
    """Motors from logs that hold rotor speed and PWM at 200 Hz or more, such as uSD logs with an RPM deck.

    Time constants up and down by simulation against measured speed; speed from PWM and voltage; thrust and moments
    from speed. Also the prediction of rotation. It uses PWM at the rate of the log, the same PWM as a radio delivers
    it, and measured speed. Whole flights are held out in turn, or --test judges. Flights of one vehicle at a
    time.
    --out gets motors.json, motors.html and simulator.toml.
    """
    if bool(train) != bool(test):
        raise UsageError("--train and --test go together; recordings given as PATH are divided")
    if train:
        no_paths_beside(options, "--train")
    check_mass(mass_kg)
    check_installed()
    flights = options.load([*train, *test] if train else None)
    inside = [not train or any(Path(f.provenance.path).is_relative_to(place) for place in train) for f in flights]
    mine = [f for f, known in zip(flights, inside, strict=True) if known]
    others = [f for f, known in zip(flights, inside, strict=True) if not known]
    study, found = study_motors(options, mine, others if train else None, mass_kg)
    say_reasons(options, ((entry.flight, entry.reason) for entry in found.left_out))
    _show(options, found)
    simulator, result = _write(options, study, found), motors_sentence(found)
    if simulator is None:
        close(options, result, "as simulator.toml", *again("--out", "motors"), screen=motors_screen(options, found))
    else:
        close(options, result, "for another simulator", "nanobench", "convert", simulator, "--to", "rotorpy", "--out",
              Path(simulator).parent / "rotorpy", screen=motors_screen(options, found))
    return options.finish("motors", to_json(replace(found, simulator=simulator)))


def motors_screen(options: Options, found: MotorResult) -> list[Grid | str]:
    """Lag, speed, thrust and rotation: fitted values with intervals."""
    title = f"Motors: {data_word(options)} data, {len(found.test)} flights held out"
    rows = [(row.input, *(f"{row.metrics[metric]['10']:.3f}" for metric, _ in SHOWN)) for row in found.rows]
    return [Grid.plain(title, ("", "fitted", "95 %", "unit"), [_cells(n) for n in fitted_numbers(found)], found.ci_why),
            Grid.plain("Rotation predicted ten steps ahead, mean error", ("input", *(h for _, h in SHOWN)), rows)]


def _cells(number: FittedNumber) -> tuple[str, ...]:
    """Times in ms, everything else with four digits."""
    factor, form, unit = (1e3, ".1f", "ms") if number.unit == "s" else (1.0, ".4g", number.unit)
    ends = "-" if number.ci95 is None else " .. ".join(f"{factor * end:{form}}" for end in number.ci95)
    return number.name, f"{factor * number.value:{form}}", ends, unit


def _write(options: Options, study: Study, found: MotorResult) -> str | None:
    """Writes simulator.toml and the page into ``--out``, or simulator.toml next to the file of ``--json``.

    Returns the path of simulator.toml."""
    from identification.motors.motor_study import simulator
    from identification.motors.motors_page import motors_page

    from ..physics.simulator import write_simulator
    from ..results.result_files import write_bytes

    beside = options.json.parent if options.json is not None and str(options.json) != "-" else None
    folder = options.out or beside
    if folder is None:
        return None
    folder.mkdir(parents=True, exist_ok=True)
    write_simulator(simulator(study), folder / "simulator.toml")
    if options.out is not None:
        page = motors_page(found, options.synthetic)
        write_bytes(options.out / "motors.html", page.encode(errors="replace"))
        options.say(f"{options.out / 'motors.html'} ({len(page) / 1e6:.1f} MB)")
    return str(folder / "simulator.toml")


def _show(options: Options, found: MotorResult) -> None:
    from ..protocols.sessions import interval_note

    _show_lag(options, found.lag, len(found.test))
    _show_speed(options, found.speed, found.force)
    _show_moments(options, found.moments)
    _show_rotation(options, found)
    options.detail(interval_note([{"sessions": found.sessions, "ci_why": found.ci_why, "n": len(found.test)}]))


def _show_lag(options: Options, part: LagPart, held_out: int) -> None:
    table = rich_table(f"Motor lag: {data_word(options)} data, {held_out} held-out flights, error of rotor speed "
                       "within seconds", ("model",), ("up ms", "down ms", "delay ms", "rad/s", "95 %"))
    for row in part.rows:
        interval = "-" if row.ci95 is None else " .. ".join(f"{x:.2f}" for x in row.ci95)
        name = row.model + (" *" if row.model == part.best else "")
        table.add_row(name + (" (no result)" if row.trouble else ""), *(f"{1e3 * t:.1f}" for t in (
            row.times.tau_up_s, row.times.tau_down_s, row.times.delay_s)), f"{row.rms_rad_s:.2f}", interval)
    options.detail(table)
    both, text = part.fit, []
    for name, key, time_s in (("up", "tau_up_s", both.tau_up_s), ("down", "tau_down_s", both.tau_down_s),
                              ("delay", "delay_s", both.delay_s)):
        ends = both.ci95.get(key)
        text.append(f"{name} {1e3 * time_s:.1f}" + (f" ({1e3 * ends[0]:.1f} .. {1e3 * ends[1]:.1f})" if ends else "")
                    + " ms")
    options.detail(f"Fitted with both: {', '.join(text)}. The delay is also that of the speed measurement.")


def _show_speed(options: Options, part: SpeedPart, force: ForcePart) -> None:
    table = rich_table(f"Rotor speed from PWM and voltage: {data_word(options)} data, training flights held out in "
                       "turn", ("map",), ("rad/s", "equation", "note"))
    for row in part.ranked:
        table.add_row(row.model + (" *" if row.model == part.best else ""), f"{row.rms_rad_s:.2f}",
                      one_line(row.equation), one_line(row.trouble))
    options.detail(table)
    if part.best is None:
        options.detail("No map is a result: none predicts flights held out better than a constant, or only one trains.")
    options.detail(f"Speeds vary by {part.spread_rad_s:.1f} rad/s (SD). Slope of thrust over motor voltage: "
                 f"{part.slope_fast_N_per_V:.4f} N/V from changes within a second, "
                 f"{part.slope_slow_N_per_V:.4f} N/V from this map.")
    value, unit = (force.k_f, "N s²/rad²") if force.k_f is not None else (force.k_f_per_kg, "N s²/rad² per kg")
    ends = "" if force.ci95 is None else f" ({force.ci95[0]:.4g} .. {force.ci95[1]:.4g})"
    options.detail(f"Thrust per squared speed: {value:.4g} {unit}{ends}; {force.identified}. Body-z specific force on "
                 "held-out flights: " + ", ".join(f"from {r.source} {r.rms_m_s2:.3f} m/s²" for r in force.rows
                                                  if not math.isnan(r.rms_m_s2)) + ".")


def _show_moments(options: Options, part: MomentPart) -> None:
    if part.explained["x"].median is not None:
        shares = ", ".join(f"{n} {100 * found.median:.0f} %" for n, found in part.explained.items()
                           if found.median is not None)
        options.detail(f"Moments from rotor speed: J_x {part.inertia_kg_m2['x']:.3g}, J_y "
                     f"{part.inertia_kg_m2['y']:.3g} kg m² ({part.identified}); share of angular acceleration "
                     f"explained (3 to 30 Hz): {shares}.")


def _show_rotation(options: Options, found: MotorResult) -> None:
    from ..protocols.compare import verdict

    rows = found.rows
    if not rows:
        options.detail("Rotation is not predicted: no onboard estimate of velocity and attitude in these logs.")
        return
    step_ms = 1e3 * found.step_s
    table = rich_table(f"Rotation predicted on held-out flights: {data_word(options)} data, mean error after 1, 10, 50 "
                       f"steps of {step_ms:.2f} ms \\[95 % after 10], {rows[0].n_windows} windows, "
                       f"{rows[0].n_flights} flights", ("input",), [heading for _, heading in SHOWN])
    for row in rows:
        cells = []
        for metric, _ in SHOWN:
            ends = row.ci95[metric].get("10")
            cells.append(" ".join(f"{row.metrics[metric][h]:.3f}" for h in ("1", "10", "50"))
                         + (f" \\[{ends[0]:.3f}, {ends[1]:.3f}]" if ends else ""))
        table.add_row(row.input, *cells)
    options.detail(table)
    for row in rows:
        options.detail(f"  {row.input}: {row.words}" + (f" ({one_line(row.trouble)})" if row.trouble else ""))
    for gain in found.gains:
        if gain.metric == SHOWN[0][0] and gain.h == 10:
            options.detail(f"{gain.input}: error of roll and pitch rate after {10 * step_ms:.0f} ms against the radio "
                         f"stream's: {verdict(*gain.ratio)}")

"""``nanobench control``: scores of controllers (Task 2): those that flew, the plant's gate, and simulated flights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import UsageError, unknown_name
from ..steps.controlling import control_body, control_screen
from ..steps.options import Options
from ..steps.result_bodies import ControlBody
from ..steps.sentences import controlled
from .closing import close_scores
from .shared_options import PATH, FiniteRange, shared_options

MODERATE = ("figure_eight", "star", "linear_ramp")

if TYPE_CHECKING:
    from ..auditing.recording_audit import Audit
    from ..flight import Flight

PLANTS = ("real", "gate", "simulated", "mismatch")
DEFAULT_PLANTS = ("real", "gate")


@click.command()
@shared_options()
@click.option("--plant", "plants", multiple=True, metavar="NAME",
              help="real: the logged flights; gate: held-out flights flown again on the plant, against their logs. "
                   "Also simulated: an ensemble of plants; mismatch: plants unlike those that controllers assume. "
                   "May repeat. "
                   "Default: real and gate.")
@click.option("--protocol", "protocols", multiple=True, metavar="NAME",
              help="Of real flights: as-published or clean; may repeat. Default: both.")
@click.option("--controller", "controllers", multiple=True, metavar="NAME",
              help="Real: onboard_pid, onboard_mellinger or the name of one of your own that flew. Simulated: a "
                   "registered name or module:Class. May repeat. Default: all.")
@click.option("--simulator", type=PATH, metavar="FILE", help="simulator.toml of the plant. Default: the recorded "
              "vehicle, as identified from the training flights of Task 1, which the gate then leaves out.")
@click.option("--train", multiple=True, type=PATH, metavar="PATH",
              help="Identify the plant from these recordings; may repeat.")
@click.option("--trajectory", "trajectories", multiple=True, metavar="NAME",
              help="Simulated: a family of paths such as figure_eight; may repeat. Default: all; for mismatch "
                   "figure_eight, star, linear_ramp.")
@click.option("--speed", "speeds", multiple=True, type=FiniteRange(min=0.05, max=5.0), metavar="M_S",
              help="Simulated: speed along the path [m/s]; may repeat. Default: 0.5 and 1.0.")
@click.option("--seconds", type=FiniteRange(min=5.0, max=600.0), default=12.0, show_default=True,
              help="Simulated: length of every path, of which the first 3 s are not scored.")
@click.option("--plants", "members", type=click.IntRange(min=1), default=12, show_default=True, metavar="N",
              help="Simulated: how many plants; the first is the median one.")
@click.option("--radio-delay-s", type=FiniteRange(min=0.0, max=0.1), default=0.0, show_default=True, metavar="S",
              help="Simulated: delay of the radio. Commands of controllers that are not on board reach the motors so "
                   "late, and these know it; references reach those on board so late.")
@click.option("--radio-silent", "silent_percent", type=FiniteRange(min=0.0, max=50.0), default=0.0,
              show_default=True, metavar="PERCENT",
              help="Simulated: the radio takes nothing for so much of the time, in gaps of 50 ms on average "
                   "(recordings: 0 to 11 %). Poses, commands of controllers that are not on board and references of "
                   "those that are wait.")
@click.option("--wind", "wind_m_s", type=FiniteRange(min=0.0, max=10.0), default=0.0, show_default=True,
              metavar="M_S", help="Simulated: a steady level wind, from a separate direction for every plant.")
@click.option("--gains", "gain_files", multiple=True, type=PATH, metavar="FILE",
              help="Simulated: a file that tune wrote; its controller flies with these gains, too. May repeat.")
@click.option("--learned", is_flag=False, flag_value="all", type=click.Choice(["all"]),
              help="Train policies cloned from the onboard PID; fly them and MPPI on learned dynamics and the plant.")
@click.option("--dagger", type=click.IntRange(min=0, max=10), default=0, show_default=True, metavar="N",
              help="Learned: rounds in which the onboard PID corrects the policies on the plant.")
def control(options: Options, plants: tuple[str, ...], protocols: tuple[str, ...], controllers: tuple[str, ...],
            simulator: Path | None, train: tuple[Path, ...], trajectories: tuple[str, ...], speeds: tuple[float, ...],
            seconds: float, members: int, radio_delay_s: float, silent_percent: float, wind_m_s: float,
            gain_files: tuple[Path, ...], learned: str | None, dagger: int) -> int:
    """Task 2: how well was it flown, and how would another controller fly it?

    Plant real: as-published is the published pair of rows with its faults. Protocol clean scores the phase in which a
    path was streamed, by family, speed and controller. Plant gate: does the plant do what held-out recordings did?
    Plant simulated: controllers on many plants that the vehicle may be, with the gate's gap next to every number.
    """
    from ..practice.references import FAMILIES
    from ..protocols import task2
    from .control_plants import Chosen, check_simulated, gate_on_clock, given_gains, mismatch_rows, simulated_rows

    if learned:
        from identification.learned.libraries import share_process

        share_process()
    wanted = tuple(dict.fromkeys(plants or (() if learned else DEFAULT_PLANTS)))
    for name in wanted:
        if name not in PLANTS:
            raise unknown_name("plant", name, PLANTS)
    for name in protocols:
        task2.check_protocol(name)
    if simulator is not None and train:
        raise UsageError("--simulator and --train both choose the plant; give one")
    flies = bool({"simulated", "mismatch"} & set(wanted))
    gains = given_gains(options, gain_files)
    specs = check_simulated([*controllers, *gains] if flies else (), trajectories or list(FAMILIES), speeds, seconds)
    chosen = Chosen.of(options, simulator, train)
    body = ControlBody()
    if {"real", "gate"} & set(wanted) or learned:
        flights = options.load()
        audits, _ = options.audit(flights)
        if "real" in wanted:
            body = _real(options, flights, audits, protocols, controllers, flies)
        if "gate" in wanted:
            body = replace(body, gate=gate_on_clock(options, flights, audits, chosen, "gate" in plants))
    if "simulated" in wanted:
        rows, part = simulated_rows(options, chosen, controllers, specs, members, body.gate.summary, radio_delay_s,
                                    wind_m_s, silent_percent / 100.0, gains)
        body = replace(body, rows=[*body.rows, *rows], simulated=part)
    if "mismatch" in wanted:
        unlike = check_simulated((), trajectories or MODERATE, speeds, seconds)
        found = mismatch_rows(options, chosen, controllers, unlike, gains)
        body = replace(body, rows=[*body.rows, *found], mismatch_plant=chosen.origin)
    if learned:
        from .control_learned import learned_rows

        paths = check_simulated((), trajectories or (task2.PUBLISHED[0],), speeds or (0.5,), seconds)
        flown, lessons = learned_rows(options, flights, audits, chosen, paths, members, body.gate.summary, dagger,
                                      gains)
        body = replace(body, rows=[*body.rows, *flown], learned=lessons)
    close_scores(options, controlled(body), "controller", control_screen(options, body))
    return options.finish("control", body)


def _real(options: Options, flights: Sequence[Flight], audits: Mapping[str, Audit], protocols: tuple[str, ...],
          controllers: tuple[str, ...], shared: bool) -> ControlBody:
    """Rows of the logged flights; ``shared``: names of controllers may also be meant for the simulated ones."""
    from ..protocols import task2

    flew = {f"onboard_{name}" if name in task2.CONTROLLERS else name: name
            for name in sorted({audit.controller for audit in audits.values()} - set(task2.UNNAMED))}
    for name in controllers:
        if name not in flew and not shared:
            raise unknown_name("controller of these recordings:", name, flew)
    if options.clock != "as-recorded":
        if set(protocols) - {"clean"}:
            raise UsageError(f"--clock {options.clock} goes with --protocol clean only: the published rows were made "
                             "as recorded")
        protocols = ("clean",)
    flights, audits = options.on_clock(flights, audits)
    known = tuple(flew[name] for name in controllers if name in flew)
    if controllers and not known:
        return ControlBody()
    return control_body(options, flights, audits, protocols, known)

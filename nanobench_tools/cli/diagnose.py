"""``nanobench diagnose``: where is my simulator wrong?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import UsageError
from ..steps.diagnose_bound import flexible
from ..steps.diagnosing import (
    ENGINES,
    Looked,
    against_callable,
    against_model,
    beliefs_of,
    check_installed,
    names_a_file,
)
from ..steps.options import Options
from ..steps.show import data_word
from ..tables.result_table import Table as Grid
from .closing import again, close, shortened, shown_page
from .known_options import knows
from .shared_options import PATH, shared_options

if TYPE_CHECKING:
    from identification.mismatch.recordings import Recordings
    from identification.mismatch.steady.known import Known
    from identification.mismatch.verdict import Verdict

    from ..flight import Flight
    from ..physics import Model

CORRECTED = "simulator_corrected.toml"
BELIEVED = "simulator_believed.toml"
EQUIVALENT = "simulator_equivalent.toml"
QUADROTOR = 4
CODE = "simulators_corrected"
"""Folder of the corrected simulator as CasADi functions and as C."""


@click.command()
@shared_options("clock")
@click.option("--simulator", metavar="WHAT",
              help="The simulator: simulator.toml; module:callable, a simulator of your own (below); or an adapter. "
                   "Adapters: rotorpy, crazyflow (their own Crazyflie), rotorpy:FILE, crazyflow:FILE (a "
                   "simulator.toml that they can express, or rotorpy_params.json), crazyflow:DRONE.")
@click.option("--simulated", multiple=True, type=PATH, metavar="PATH",
              help="Recordings a simulator produced, instead of --simulator: its parameters are identified from them "
                   "first. May repeat.")
@click.option("--mass", "mass_kg", type=float, default=0.04085, show_default=True, metavar="KG",
              help="Mass the simulator was given, with --simulated and module:callable: flights show only thrust over "
                   "mass.")
@click.option("--normal", multiple=True, type=PATH, metavar="PATH",
              help="Normal flights of the same vehicle: reports what changed since, from the steady trim of the "
                   "motors alone. For logs without full attitude or gyro. With --simulator FILE, which gives the "
                   "positions of the motors. May repeat.")
@knows("--normal")
@click.option("--engine", type=click.Choice(ENGINES), default=None, show_default=f"{ENGINES[0]}; rules with --refit",
              help="What decides: the probability of every set of up to three effects, or the older rules. "
                   "docs/mismatch.md compares them.")
@click.option("--bound", is_flag=True,
              help="Also train a network on what the simulator leaves (extra learned; a minute more): how much better "
                   "anything could predict these flights.")
@click.option("--refit", is_flag=True,
              help="Also refit the identified effects to predictions 0.1 and 0.5 s ahead, judged by flights left out "
                   "in turn. The corrected simulator uses the refit only where it predicts these better (seldom; see "
                   "docs).")
def diagnose(options: Options, simulator: str | None, simulated: tuple[Path, ...], mass_kg: float,
             normal: tuple[Path, ...], known: Known, engine: str | None, bound: bool,
             refit: bool) -> int:
    """Where is my simulator wrong? Locates, names and models what it leaves out, and proves it on unseen flights.

    Recordings are checked first: faults of the data are reported and left out, and a wandering clock is re-timed. The
    simulator's output along the measured states is then compared with the measurement. Every effect of the vocabulary
    is tried as an explanation; the unexplained rest is called unknown. --out DIR gets verdict.json and report.html.
    Where an effect was identified, it also gets simulator_corrected.toml and the same as CasADi functions and C.

    \b
    A simulator of your own is called once for every stretch of flight of n rows:
      def accelerations(along):              # my_simulator.py -> --simulator my_simulator:accelerations
          lift = 0.0105 * (along.motor * along.battery_V[:, None]) ** 2    # N, (n, 4)
          force, torque = ...                                              # N, N m, body, (n, 3)
          return force / 0.041, torque / np.array([1.8e-5, 1.8e-5, 3.1e-5])

    along.time_s (n), position_m, velocity_m_s (n, 3; world), quaternion (n, 4; x y z w), rotation (n, 3, 3; body to
    world), rate_rad_s (n, 3; body), motor (n, 4; 0..1), battery_V (n), row_s. Returned: specific force in the body
    m/s^2 (+9.81 in z at hover) and angular acceleration rad/s^2, both (n, 3). A class with reset() and step(row) works
    too. Terms are fitted to its output (simulator_equivalent.toml), and the diagnosis reports how well they reproduce
    it. Where they do not, no effect is identified. More: nanobench_tools/physics/adapters/given.py.
    """
    from identification.mismatch.headline import headline

    from ..physics.simulator import read_simulator, write_simulator
    from .convert import export_simulators

    if normal:
        if bound or refit:
            raise UsageError(f"diagnose: --{'bound' if bound else 'refit'} predicts paths, which --normal does not; "
                             "give --simulator WHAT")
        return _against_normal(options, simulator, simulated, mass_kg, normal, known)
    if known.options:
        raise UsageError(f"diagnose: {known.options[0]} goes with --normal DIR")
    if refit and engine == "posterior":
        raise UsageError("diagnose: --refit needs --engine rules: the posterior weighs predictions anyway")
    engine = engine or ("rules" if refit else ENGINES[0])
    if bound:
        from identification.learned.libraries import libraries

        libraries()  # report its absence before anything is computed
    if (simulator is None) == (not simulated):
        raise UsageError("diagnose: give either --simulator WHAT or --simulated DIR, which say what is believed, or "
                         "--normal DIR, flights to compare with")
    check_installed()
    if simulator is not None and not names_a_file(simulator):
        from ..physics.adapters.given import load_simulator
        from ..physics.vehicle import sized

        sized(mass_kg)
        found = load_simulator(simulator)
        judged = against_callable(options, options.load(), found, simulator, mass_kg, engine)
    else:
        model = None if simulator is None else read_simulator(Path(simulator))
        flights = options.load()
        model = model or _beliefs(options, flights, simulated, mass_kg)
        recordings = Looked(options, flights).at(model.vehicle, "thrust_voltage" in model)
        if not recordings.tracks and (code := _from_trim(options, model)) is not None:
            return code
        judged = against_model(options, recordings, model, simulator or "--simulated", engine)
    verdict = judged.verdict
    body = dict(verdict.to_json())
    if refit and verdict.reasoned is not None:
        verdict, body["refit"] = _refitted(options, verdict)
    if verdict.believed is not None and options.out is not None:
        write_simulator(verdict.believed, options.out / EQUIVALENT)
        body["simulator"] = {**body["simulator"], "equivalent": str(options.out / EQUIVALENT)}
    if verdict.corrected is not None and options.out is not None:
        path = options.out / CORRECTED
        write_simulator(verdict.corrected, path)
        body["corrected_simulator"] = str(path)
        export_simulators(verdict.corrected, options.out / CODE, ("casadi", "c"))
    if bound and verdict.left is not None:
        believes = verdict.believed or judged.believed
        assert believes is not None  # a callable without an equivalent has nothing left to draw
        body["bound"] = flexible(options, verdict, judged.recordings, believes)
    _show(options, body, verdict)
    _write_page(options, verdict, judged.recordings)
    why, command = ("a page, and the corrected simulator where there is one", again("--out", "diagnosis"))
    if options.out is not None:
        why, command = ("see it", list[object](shown_page(options.out / "report.html")))
        if verdict.corrected is not None:
            why, command = ("fly the corrected vehicle, simulated", [
                "nanobench", "simulate", "--serve", "udp://127.0.0.1:19850", "--simulator", options.out / CORRECTED])
    further = [body[key] if isinstance(body[key], str) else body[key]["sentence"] if isinstance(body[key], dict)
               else body[key].sentence for key in ("refit", "bound") if body.get(key)]
    close(options, "" if options.verbose else headline(body), why, *command, screen=[
        *([] if options.verbose else verdict_screen(options, body)), *further])
    return options.finish("verdict", body)


def _refitted(options: Options, verdict: Verdict) -> tuple[Verdict, dict[str, Any]]:
    """The verdict, with the refit as its corrected simulator where that predicts unseen flights better; ``refit`` of
    verdict.json."""
    from identification.mismatch.refit import refit

    assert verdict.reasoned is not None
    options.say("refit to predictions")
    again = refit(*verdict.reasoned, options.seed)
    if isinstance(again, str):
        return verdict, {"taken": False, "sentence": f"No refit: {again}."}
    return (replace(verdict, corrected=again.model) if again.taken else verdict), again.to_json()


def _against_normal(options: Options, simulator: str | None, simulated: Sequence[Path], mass_kg: float,
                    normal: Sequence[Path], known: Known) -> int:
    from .diagnose_normal import diagnose_normal

    if simulated or (simulator is not None and not names_a_file(simulator)):
        raise UsageError("diagnose: --normal goes with --simulator FILE, with nothing else that is believed")
    source = click.get_current_context().get_parameter_source("mass_kg")
    given = source is not None and source.name != "DEFAULT"
    return diagnose_normal(options, normal, None if simulator is None else Path(simulator), mass_kg if given else None,
                           known)


def _from_trim(options: Options, model: Model) -> int | None:
    """The exit code of a verdict from the steady trim, for flights without the streams that show how they moved."""
    from identification.mismatch.track import missing

    from .diagnose_normal import diagnose_trim

    rotors = model.vehicle.rotors
    lacking = [missing(flight, rotors=rotors) for flight in options.flights]
    if "thrust_voltage" in model and all(lacks == ["battery"] for lacks in lacking):
        return None  # commands at an unknown voltage are no thrust to compare
    if rotors != QUADROTOR or not any(lacking):
        return None  # the trim of four motors is all that is known
    return diagnose_trim(options, model)


def _beliefs(options: Options, flights: Sequence[Flight], simulated: Sequence[Path], mass_kg: float) -> Model:
    """What the simulator that made the recordings believes; written to ``--out`` too."""
    from ..physics.simulator import write_simulator

    theirs = replace(options, data=tuple(simulated), flights=[])
    model = beliefs_of(theirs, flights, theirs.load(), mass_kg)
    if options.out is not None:
        write_simulator(model, options.out / BELIEVED)
    return model


def _write_page(options: Options, verdict: Verdict, recordings: Recordings) -> None:
    """report.html into ``--out``."""
    if options.out is None:
        return
    from identification.mismatch.page import write_page

    path = options.out / "report.html"
    write_page(verdict, recordings, path, options.synthetic)
    options.say(f"{path} ({path.stat().st_size / 1e6:.1f} MB)")


def verdict_screen(options: Options, body: Mapping[str, Any]) -> list[Grid | str]:
    """The outcome, what the simulator is good for, what was found with its interval, predictions of flights left out;
    without a finding the paragraph."""
    from identification.mismatch.headline import headline, one_of, uses

    from ..physics.term_words import in_words

    word, found = data_word(options), body.get("improvement") or {}
    rows = [(f"{in_words(entry['term'])} {name.partition('.')[2]}", f"{p['believed']:.4g}", f"{p['value']:.4g}",
             f"{p['ci95'][0]:.4g} .. {p['ci95'][1]:.4g}", p["unit"], f"{entry['confidence']:.2f}")
            for entry in body["findings"] for name, p in entry["parameters"].items()]
    steps = [(f"{0.01 * int(h):.2f} s", *(_step(before, found[h]["after"][q])
                                          for q, before in found[h]["before"].items()))
             for h in ("1", "10", "50") if h in found]
    return [f"{word} data, {_outcome(body)}. "
            + (uses(body["good_for"]) if body.get("good_for") else ""),
            Grid.plain("What the simulator leaves out", ("term", "simulator", "flights", "95 %", "unit", "sure"), rows),
            "; ".join(f"{one_of(f)}: these flights cannot distinguish them" for f in body["findings"]
                      if f["equivalent"]),
            Grid.plain(f"Prediction of {len(left)} flights left out" if (left := found.get("held_out")) else
                       "Prediction of the same flights, none left out",
                       ("after", "position m", "velocity m/s", "attitude rad", "rate rad/s"), steps),
            "" if rows else shortened(body["paragraph"].removeprefix(headline(body)).lstrip())]


def _outcome(body: Mapping[str, Any]) -> str:
    """The outcome in capitals."""
    if body.get("thrust_ratio"):
        return "ANOTHER VEHICLE"
    return "NOTHING IDENTIFIED" if body["outcome"] == "none" else str(body["outcome"]).upper().replace("_", " ")


def _show(options: Options, body: Mapping[str, Any], verdict: Verdict) -> None:
    """The paragraph, and tables of findings and predictions."""
    from rich.table import Table

    from identification.mismatch.headline import RULES, headline, uses

    from ..physics.term_words import in_words

    word = data_word(options)
    options.detail(f"\n{word} data, {_outcome(body)}. {headline(body)}")
    if body.get("good_for"):
        options.detail(uses(body["good_for"]))
        if body.get("good_for_corrected"):
            options.detail(f"Corrected: {uses(body['good_for_corrected'])}")
        options.detail("Rule: " + "; ".join(f"{use}: {rule}" for use, rule in RULES.items()) + ".")
    options.detail(f"\n{body['paragraph']}\n")
    if body["findings"]:
        table = Table(title=f"What the simulator leaves out, {word}", title_justify="left")
        for column in ("term", "or", "confidence", "parameter", "simulator", "flights say", "95 %", "unit"):
            table.add_column(column, overflow="fold")
        for entry in body["findings"]:
            others = ", ".join(map(in_words, entry["equivalent"]))
            for i, (name, p) in enumerate(entry["parameters"].items()):
                lead = (in_words(entry["term"]), others, f"{entry['confidence']:.2f}")
                table.add_row(*(lead if i == 0 else ("", "", "")), name.partition(".")[2], f"{p['believed']:.5g}",
                              f"{p['value']:.5g}", f"{p['ci95'][0]:.5g} .. {p['ci95'][1]:.5g}", p["unit"])
        options.detail(table)
        table = Table(title=f"Prediction of flights left out of the fit, n = {len(body['improvement']['held_out'])} "
                            f"flights, {word}", title_justify="left")
        for column in ("steps of 10 ms", "position m", "velocity m/s", "attitude rad", "rate rad/s"):
            table.add_column(column)
        for h in ("1", "10", "50"):
            entry = body["improvement"][h]
            table.add_row(h, *(_step(entry["before"][q], entry["after"][q]) for q in entry["before"]))
        options.detail(table)


def _step(before: float | None, after: float | None) -> str:
    """An error before and after a correction, or the only one; of what was given, and not predicted, none."""
    if before is None or after is None:
        return "given"
    return f"{before:.4f}" if before == after else f"{before:.4f} -> {after:.4f}"

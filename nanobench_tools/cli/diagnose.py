"""``nanobench diagnose``: where is my simulator wrong?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import MissingExtraError, UsageError
from .options import PATH, Options, shared_options
from .show import data_word

if TYPE_CHECKING:
    from identification.mismatch.recordings import Recordings
    from identification.mismatch.verdict import Verdict

    from ..physics import Model

CORRECTED = "simulator_corrected.toml"
BELIEVED = "simulator_believed.toml"
CODE = "simulators_corrected"
"""Folder of the corrected simulator as CasADi functions and as C."""


@click.command()
@shared_options("clock")
@click.option("--simulator", type=PATH, metavar="FILE", help="simulator.toml: what is believed of the vehicle.")
@click.option("--simulated", multiple=True, type=PATH, metavar="PATH",
              help="Recordings a simulator produced, instead of --simulator: what it believes is identified from them "
                   "first. May repeat.")
@click.option("--mass", "mass_kg", type=float, default=0.04085, show_default=True, metavar="KG",
              help="Mass the simulator was given, with --simulated: flights show only thrust over mass.")
def diagnose(options: Options, simulator: Path | None, simulated: tuple[Path, ...], mass_kg: float) -> int:
    """Where is my simulator wrong? Locates, names and models what it leaves out, and proves it on unseen flights.

    Recordings are looked over first: faults of the data are said and left out, a wandering clock is re-timed. What the
    simulator would have produced along the measured states is then compared with what was measured, every effect of
    the vocabulary is tried as an explanation, and what none explains is called unknown. --out DIR gets verdict.json,
    report.html and, where something was named, simulator_corrected.toml and the same as CasADi functions and C.
    """
    import importlib.util

    from ..physics.simulator import read_simulator, write_simulator
    from .convert import export_simulators

    if (simulator is None) == (not simulated):
        raise UsageError("diagnose: give either --simulator FILE or --simulated DIR, which say what is believed")
    if importlib.util.find_spec("casadi") is None:
        raise MissingExtraError("casadi", "identification")
    model = read_simulator(simulator) if simulator is not None else _beliefs(options, simulated, mass_kg)
    from identification.mismatch.diagnose import diagnose as run_diagnosis

    recordings = _looked_over(options, "thrust_voltage" in model)
    verdict = run_diagnosis(recordings, model, seed=options.seed, progress=options.say)
    body = dict(verdict.to_json())
    if verdict.corrected is not None and options.out is not None:
        path = options.out / CORRECTED
        write_simulator(verdict.corrected, path)
        body["corrected_simulator"] = str(path)
        export_simulators(verdict.corrected, options.out / CODE, ("casadi", "c"))
    _show(options, body, verdict)
    _write_page(options, verdict, recordings)
    return options.finish("verdict", body)


def _looked_over(options: Options, with_battery: bool) -> Recordings:
    from identification.mismatch.recordings import look_over

    flights = options.load()
    audits, _ = options.audit(flights)
    moved = replace(options, clock="retimed").see_on_clock(flights, audits)
    return look_over([f for f in flights if f.name in audits], audits, moved.flights, moved.audits, with_battery)


def _beliefs(options: Options, simulated: Sequence[Path], mass_kg: float) -> Model:
    """What the simulator that made the recordings believes; written to ``--out`` too."""
    from identification.mismatch.believe import beliefs

    from ..physics import Vehicle
    from ..physics.simulator import write_simulator
    from ..physics.vehicle import BOUNDS

    low, high = BOUNDS["mass_kg"]
    if not low <= mass_kg <= high:
        raise UsageError(f"--mass {mass_kg:g} kg is outside {low:g} to {high:g} kg; is it in grams?")
    theirs = replace(options, data=tuple(simulated), flights=[])
    model = beliefs(_looked_over(theirs, True), Vehicle(mass_kg=mass_kg), options.say)
    options.say(f"the simulator believes {', '.join(t.name for t in model.terms)}")
    if options.out is not None:
        write_simulator(model, options.out / BELIEVED)
    return model


def _write_page(options: Options, verdict: Verdict, recordings: Recordings) -> None:
    """report.html into ``--out``."""
    import importlib.util

    if options.out is None:
        return
    if importlib.util.find_spec("plotly") is None:
        options.say("report.html was not written: its pictures need plotly; pip install 'nanobench[report]'")
        return
    from identification.mismatch.page import write_page

    path = options.out / "report.html"
    write_page(verdict, recordings, path, options.synthetic)
    options.say(f"{path} ({path.stat().st_size / 1e6:.1f} MB)")


def _show(options: Options, body: Mapping[str, Any], verdict: Verdict) -> None:
    """The paragraph, and tables of findings and predictions."""
    from rich.table import Table

    options.show(f"\n{body['outcome'].upper().replace('_', ' ')}. {body['paragraph']}\n")
    word = data_word(options)
    if body["findings"]:
        table = Table(title=f"What the simulator leaves out, {word}", title_justify="left")
        for column in ("term", "or", "confidence", "parameter", "simulator", "flights say", "95 %", "unit"):
            table.add_column(column, overflow="fold")
        for entry in body["findings"]:
            for i, (name, p) in enumerate(entry["parameters"].items()):
                lead = (entry["term"], ", ".join(entry["equivalent"]), f"{entry['confidence']:.2f}")
                table.add_row(*(lead if i == 0 else ("", "", "")), name.partition(".")[2], f"{p['believed']:.5g}",
                              f"{p['value']:.5g}", f"{p['ci95'][0]:.5g} .. {p['ci95'][1]:.5g}", p["unit"])
        options.show(table)
        table = Table(title=f"Prediction of flights left out of the fit, n = {len(body['improvement']['held_out'])} "
                            f"flights, {word}", title_justify="left")
        for column in ("steps of 10 ms", "position m", "velocity m/s", "attitude rad", "rate rad/s"):
            table.add_column(column)
        for h in ("1", "10", "50"):
            entry = body["improvement"][h]
            table.add_row(h, *(f"{entry['before'][q]:.4f} -> {entry['after'][q]:.4f}" for q in entry["before"]))
        options.show(table)

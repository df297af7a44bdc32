"""``nanobench diagnose --normal``: what changed on a vehicle, against its own normal flights, from the steady trim."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..steps.diagnosing import check_possible
from ..steps.options import Options
from ..steps.show import data_word
from ..tables.result_table import Table
from .closing import again, close, shortened, shown_page
from .real_folders import copies_between

if TYPE_CHECKING:
    from identification.mismatch.steady.known import Known

    from ..flight import Flight
    from ..physics import Model

NORMAL_SIMULATOR, CORRECTED = "simulator_normal.toml", "simulator_corrected.toml"


def diagnose_normal(options: Options, normal: Sequence[Path], simulator: Path | None, mass_kg: float | None,
                    knowledge: Known) -> int:
    """The verdict on ``--data`` against the recordings of ``normal``."""
    from identification.mismatch.steady.comparison import compare, normal_flights
    from identification.mismatch.steady.trim_inputs import body_of, trims_in
    from identification.mismatch.steady.trim_page import write_steady_page
    from identification.mismatch.steady.trim_simulator import corrected, simulator_of

    from ..auditing.recording_audit import find_copies
    from ..physics.simulator import read_quadrotor, write_simulator

    for path in normal:
        if not path.exists():
            raise InputError(f"--normal {path}", "does not exist")
    model = None if simulator is None else read_quadrotor(simulator, "the trim of --normal")
    if model is not None:
        check_possible(model, str(simulator))
    here, usual = options.load(), options.load(normal)
    flights, known = _apart(here, usual)
    copies = copies_between({"the normal flights": known, "these flights": flights}, find_copies([*known, *flights]))
    copies = {name: why for name, why in copies.items() if name in {f.name for f in flights}}
    usual_trims, usual_swings, lost = trims_in(_values(options, known, {}))
    if len(usual_trims) < 2:
        reasons = "; ".join(f"{name}: {why}" for name, why in lost.items())
        raise InputError("--normal", f"{len(usual_trims)} of {len(known)} flights have a trim"
                         + (f" ({reasons})" if reasons else ""), "two are needed: one has no spread")
    body = body_of(usual_trims, mass_kg, model, knowledge)
    reference = normal_flights(usual_trims, body, knowledge)
    trims, swings, left_out = trims_in(_values(options, flights, copies))
    verdict = compare(trims, reference, body, left_out=left_out, swings=(swings, usual_swings))
    believed = simulator_of(reference.normal, body)
    if believed is not None and options.out is not None:
        write_simulator(believed, options.out / NORMAL_SIMULATOR)
        verdict["normal_simulator"] = str(options.out / NORMAL_SIMULATOR)
        better = corrected(believed, verdict["findings"][0]) if verdict["findings"] else None
        if better is not None:
            write_simulator(better, options.out / CORRECTED)
            verdict["corrected_simulator"] = str(options.out / CORRECTED)
    if options.out is not None:
        write_steady_page({"Verdict": verdict}, options.out / "report.html", options.synthetic)
    _close(options, verdict)
    return options.finish("verdict", verdict)


def diagnose_trim(options: Options, simulator: Model) -> int | None:
    """The verdict on recordings without the states that a diagnosis of motion needs: the trim they hover with against
    the one the simulator would. None where fewer than two have a trim, or the simulator has none."""
    from identification.mismatch.steady.comparison import FEWEST, Flights, compare
    from identification.mismatch.steady.trim_inputs import body_of, trims_in
    from identification.mismatch.steady.trim_page import write_steady_page
    from identification.mismatch.steady.trim_simulator import believed_by, corrected
    from identification.mismatch.track import missing
    from identification.mismatch.verdict import UNASKED

    from ..physics.simulator import write_simulator

    believed = believed_by(simulator)
    trims, _, left_out = trims_in(_values(options, options.flights, {}))
    if believed is None or len(trims) < FEWEST:
        return None
    options.say("no states to follow the motion with: the steady trim of the motors is compared")
    verdict = compare(trims, Flights(believed, (), {}), body_of(trims, None, simulator), left_out=left_out)
    lacks = dict.fromkeys(name for flight in options.flights for name in missing(flight))
    verdict["paragraph"] = " ".join([verdict["paragraph"], *(f"Without {name} {UNASKED[name]}." for name in lacks)])
    better = corrected(simulator, verdict["findings"][0]) if verdict["findings"] else None
    if options.out is not None:
        if better is not None:
            write_simulator(better, options.out / CORRECTED)
            verdict["corrected_simulator"] = str(options.out / CORRECTED)
        write_steady_page({"Verdict": verdict}, options.out / "report.html", options.synthetic)
    _close(options, verdict)
    return options.finish("verdict", verdict)


def _apart(here: Sequence[Flight], usual: Sequence[Flight]) -> tuple[list[Flight], list[Flight]]:
    """Both with names that no other has."""
    from dataclasses import replace

    taken = {f.name for f in here}
    return list(here), [replace(f, name=f"normal/{f.name}") if f.name in taken else f for f in usual]


def _values(options: Options, flights: Sequence[Flight], copies: Mapping[str, str]) -> dict[str, Mapping[str, Any]]:
    from identification.mismatch.steady.trim_inputs import trim_item

    from ..harness import make_item

    items = {f.name: make_item(trim_item, {"flight": f}, f"trim of {f.name}") for f in flights if f.name not in copies}
    found = options.run(list(items.values()), "steady trims").values
    return {**{name: found[item.key] for name, item in items.items() if item.key in found},
            **{name: {"why": why} for name, why in copies.items()}}


def _close(options: Options, verdict: Mapping[str, Any]) -> None:
    """The verdict on one screen, with ``--verbose`` whole."""
    why, command = ("the verdict as a page", again("--out", "diagnosis")) if options.out is None else (
        "see it", list[object](shown_page(options.out / "report.html")))
    result = f"{verdict['outcome'].upper().replace('_', ' ')}. {verdict['paragraph']}"
    trim, found = verdict.get("trim"), verdict["findings"]
    rows = [] if trim is None else [
        (row["flight"], *(f"{c:+.1f}" for c in row["change_percent"]),
         "-" if row["battery_V"] is None else f"{row['battery_V']:.2f}") for row in trim["flights"]]
    if trim is not None:
        mean = [("mean", *(f"{c:+.1f}" for c in trim["change_percent"]), "-"),
                ("sd of the mean", *([f"{trim['sd_percent']:.1f}"] * 4), "-")]
        rows = [*mean, *rows]
    usual = "the simulator" if trim is None or not trim["normal"] else f"{len(trim['normal'])} normal flights"
    causes = [(" or ".join(f["causes"]), ", ".join(map(str, f["motors"])), f"{f['confidence']:.2f}", name,
               *(("", "", "") if p is None else (f"{p['value']:.3g}", f"{p['ci95'][0]:.3g} .. {p['ci95'][1]:.3g}",
                                                 p["unit"])))
              for f in found for name, p in list(f["parameters"].items()) or [("", None)]]
    word = data_word(options)
    close(options, result if options.verbose else shortened(result), why, *command, screen=[
        Table.plain(f"What changed, {word}", ("cause", "motors", "confidence", "size", "flights", "95 %", "unit"),
                    causes),
        Table.plain(f"Thrust commanded of each motor against {usual}, %, {word}",
                    ("flight", "motor 1", "motor 2", "motor 3", "motor 4", "battery V"), rows)])

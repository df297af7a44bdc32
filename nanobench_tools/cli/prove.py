"""``nanobench prove``: what a diagnosis is worth, on cases whose truth is sealed until all verdicts are there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import InputError, UsageError
from ..results.result import to_json
from ..steps.blind_proofs import blind_proof, proof_sentence
from ..steps.diagnosing import ENGINES, check_installed, engine_of_flights
from ..steps.motor_fits import check_mass
from ..steps.options import Options, one_line
from ..steps.show import data_word, rich_table
from ..tables.result_table import Table as Grid
from .closing import again, close, shown_page
from .known_options import knows
from .prove_corrupted import DEFAULT_PLACES
from .prove_corrupted import corrupted as wrong_simulators
from .prove_shipped import shipped as shipped_wrong
from .real_folders import HEADS, NORMAL, copies_between, real_folders, rows, sentences, show_folders
from .shared_options import PATH, shared_options

if TYPE_CHECKING:
    from rich.table import Table

    from identification.mismatch.steady.known import Known
    from identification.prove.blind_proof import Proof
    from identification.prove.concealed import RealProof
    from identification.prove.folder_score import FolderProof
    from identification.prove.summary import Share, TermPower

CASES, REAL_CASES = 200, 12
MASS_KG = 0.04085
"""Of the vehicle of NanoBench, as its paper gives it (``published_physics``)."""
FLYING = ("practice", "rotorpy", "both")


@click.command()
@shared_options("data", "columns", "clock")
@click.option("--cases", type=click.IntRange(min=1), metavar="N",
              help=f"How many. Default: {CASES}, {REAL_CASES} with --concealed. Of each vehicle with "
                   "--corrupted: all.")
@click.option("--kind", "kinds", multiple=True, metavar="KIND",
              help="null, single, twin, pair, fault, change, foreign; may repeat. Default: all, in fixed shares.")
@click.option("--engine", metavar="NAME",
              help="Engine that flies the cases: practice (of this project), rotorpy, or both in turn (default). "
                   "Practice also flies what RotorPy cannot, and everything where it is not installed; every case "
                   "reports its engine. With --corrupted and --shipped: what diagnoses, posterior (default), rules or "
                   "module:function.")
@click.option("--diagnosed-by", type=click.Choice(ENGINES), default=None,
              help="What diagnoses made-up cases and those of --concealed and --corrupted. Default: posterior.")
@click.option("--concealed", is_flag=False, flag_value=DEFAULT_PLACES, metavar="[DIR]",
              help="Real recordings instead (default: where other verbs look): a simulator fitted to some flights, "
                   "one piece of knowledge taken away, diagnosed on others. Logs with rotor speed: with the speed, "
                   "every other one makes a simulator; without speed and lag the others are diagnosed.")
@click.option("--corrupted", is_flag=False, flag_value=DEFAULT_PLACES, metavar="[DIR]",
              help="Real recordings of known vehicles below DIR (default: the default places of other verbs). A "
                   "simulator fitted to some flights gets a wrong parameter and is diagnosed on others.")
@click.option("--shipped", is_flag=False, flag_value=DEFAULT_PLACES, metavar="[DIR]",
              help="Real recordings below DIR (default: as for --corrupted) against public simulators that shipped "
                   "with a wrong parameter, before and after their makers' correction.")
@click.option("--case", "names", multiple=True, metavar="NAME", help="Of --shipped: this case only; may repeat.")
@click.option("--vehicle", "vehicles", multiple=True, metavar="NAME",
              help="Of --corrupted: this vehicle only; may repeat.")
@click.option("--leave-vehicle-out", "left_out", multiple=True, metavar="NAME",
              help="Of --corrupted: all vehicles but this one; may repeat.")
@click.option("--groups", type=click.IntRange(min=1), metavar="N",
              help="Of --corrupted: groups of flights a vehicle. Default: 2.")
@click.option("--mass", "mass_kg", type=float, default=None, metavar="KG",
              help=f"Mass of the vehicle of --concealed (default {MASS_KG}) or --real (default: what the firmware's "
                   "thrust curve gives).")
@click.option("--real", type=PATH, metavar="DIR",
              help="Real folders instead, one per change of the vehicle, one of them normal. Every other one is "
                   "diagnosed blind against it, and each normal flight against the other normal ones.")
@click.option("--labels", type=PATH, metavar="FILE",
              help="The change of each folder, for --real; opened after the verdicts.")
@click.option("--normal", metavar="FOLDER", help="The normal folder of --real, or a folder elsewhere. Default: normal.")
@click.option("--simulator", type=PATH, metavar="FILE", help="simulator.toml of the vehicle of --real: where its "
                                                             "motors sit, and its mass.")
@knows("--real")
def prove(options: Options, cases: int | None, kinds: tuple[str, ...], engine: str | None, diagnosed_by: str | None,
          concealed: str | None, corrupted: str | None, shipped: str | None, names: tuple[str, ...],
          vehicles: tuple[str, ...], left_out: tuple[str, ...], groups: int | None, mass_kg: float | None,
          real: Path | None, labels: Path | None, normal: str | None, simulator: Path | None, known: Known) -> int:
    """Blind proof of "nanobench diagnose": is what it names there, and does it say so when it does not know?

    --corrupted diagnoses real flights against simulators with a wrong belief, whose right value is known.

    --shipped does the same with public simulators whose makers or users found a parameter wrong.

    Cases are flown with effects that the simulator does not have. Kinds: single, pair, twin (one that is easily
    confused with another) and change (from one flight on). Other kinds have no effect (null), wrong data (fault), or
    physics that no term describes (foreign). The hash of all truths is written to --out before
    the first case is diagnosed; they are opened after the last verdict.

    An identified effect is right if it is the concealed term or a declared twin (mass and thrust_scale). It is also
    right if the finding lists the concealed term as indistinguishable from it. Every other finding is a false name. A
    small effect that is not named counts as right when it lies below the smallest detectable size that the verdict
    states.
    """
    if mass_kg is not None:
        check_mass(mass_kg)
    if shipped is not None:
        if corrupted is not None or concealed is not None or real is not None or kinds or cases is not None:
            raise UsageError("--shipped goes with none of --corrupted, --concealed, --real, --kind and --cases")
        check_installed()
        return options.finish("shipped", to_json(shipped_wrong(
            options, shipped, names, engine or diagnosed_by or ENGINES[0])))
    if names:
        raise UsageError("--case belongs to --shipped")
    if corrupted is not None:
        if concealed is not None or real is not None or kinds:
            raise UsageError("--corrupted goes with none of --concealed, --real and --kind")
        if engine is not None and diagnosed_by is not None:
            raise UsageError("--corrupted: give --diagnosed-by or --engine")
        check_installed()
        return options.finish("corrupted", to_json(wrong_simulators(
            options, corrupted, cases, engine or diagnosed_by or ENGINES[0], vehicles, left_out, groups)))
    if vehicles or left_out or groups is not None:
        raise UsageError("--vehicle, --leave-vehicle-out and --groups belong to --corrupted")
    if engine not in (None, *FLYING):
        raise UsageError(f"--engine {engine}: {', '.join(FLYING)} fly cases; another one belongs to --corrupted")
    engine = engine or "both"
    if real is not None:
        if concealed is not None or kinds or labels is None:
            raise UsageError("--real needs --labels FILE" if labels is None else
                             "--real goes with neither --concealed nor --kind")
        if diagnosed_by is not None:
            raise UsageError("--diagnosed-by does not go with --real: the steady trim has one method")
        return options.finish("prove", to_json(_real(options, real, labels, normal, simulator, mass_kg,
                                                       known)))
    if labels is not None or normal is not None or simulator is not None:
        raise UsageError("--labels, --normal and --simulator belong to --real DIR")
    if known.options:
        raise UsageError(f"{known.options[0]} belongs to --real DIR")
    check_installed()
    if concealed is None:
        return options.finish("prove", {**to_json(_blind(
            options, cases or CASES, kinds, engine, diagnosed_by or ENGINES[0])), "synthetic": True})
    if kinds:
        raise UsageError("--kind and --concealed do not go together")
    return options.finish("prove", to_json(_concealed(options, cases or REAL_CASES, concealed, mass_kg or MASS_KG,
                                                    diagnosed_by or ENGINES[0])))


def _blind(options: Options, n: int, kinds: Sequence[str], engine: str, diagnosed_by: str) -> Proof:
    found = blind_proof(options, n, kinds, engine, diagnosed_by)
    show_proof(options, found, "SYNTHETIC")
    _close(options, found.summary.right, found.summary.cases, found.summary.false_names, [Grid.plain(
        f"Blind proof, SYNTHETIC data, {found.summary.cases} cases [exact 95 %]",
        ("kind", "cases", "right", "false names"), [(kind, str(row.n), share_text(row), share_text(row.false_names))
         for kind, row in found.summary.by_kind.items()])])
    return found


def _concealed(options: Options, n: int, place: str, mass_kg: float, diagnosed_by: str) -> RealProof:
    from identification.prove.concealed import RealCase, RealProof, dead_logs, diagnose_real, fit_simulators, real_cases
    from identification.prove.hidden_speed import SPEED, speed_cases, with_speed
    from identification.prove.summary import power_by_term, summarise

    from ..protocols import task1

    options.data = () if place == DEFAULT_PLACES else (Path(place),)
    flights = options.load()
    spinning = with_speed(flights)
    train, chosen = [f.name for f in spinning[::2]], list[RealCase]()
    if spinning:
        chosen = speed_cases(spinning, mass_kg, options.run, options.seed, 0)
    others = [f for f in flights if f not in spinning]
    if others and not all(SPEED in f for f in flights):
        audits, _ = options.audit(others)
        split = task1.split(others, audits)
        simulators = fit_simulators(split, options.run, options.seed, mass_kg)
        chosen += real_cases(split, simulators, n, options.seed, len(chosen))
        chosen += dead_logs(split, audits, simulators, len(chosen))
        train += [case.flight.name for case in split.train]
    scored = diagnose_real(chosen, options.run, engine_of_flights(diagnosed_by), options.seed)
    found = RealProof(tuple(scored), summarise(scored), power_by_term(scored), tuple(train))
    show_real(options, found)
    _close(options, found.summary.right, found.summary.cases, found.summary.false_names, [Grid.plain(
        f"Knowledge taken from a fitted simulator, {data_word(options)} data [exact 95 %]",
        ("taken away", "cases", "named", "false names"),
        [(kind, str(row.n), share_text(row), str(row.false_names.right))
         for kind, row in found.summary.by_kind.items()])])
    return found


def _real(options: Options, place: Path, labels: Path, normal: str | None, simulator: Path | None,
          mass_kg: float | None, known: Known) -> FolderProof:
    """Folders diagnosed against the normal one; the labels are opened when all verdicts are there."""
    from identification.mismatch.steady.trim_page import write_steady_page
    from identification.prove.condition_labels import read_labels
    from identification.prove.folder_score import score_folders
    from identification.prove.folders import LEAVE_ONE_OUT, judge

    from ..auditing.recording_audit import find_copies
    from ..physics.simulator import read_quadrotor

    if not labels.is_file():
        raise InputError(f"--labels {labels}", "does not exist")
    model = None if simulator is None else read_quadrotor(simulator, "the trim of --real")
    groups, usual, elsewhere = real_folders(options, place, normal)
    if not usual:
        raise InputError(f"--real {place}", "no normal flight could be read", "--normal names the folder")
    everything = {NORMAL: usual, **groups} if NORMAL not in groups else {"normal flights": usual, **groups}
    copies = copies_between(everything, find_copies([f for flights in everything.values() for f in flights]))
    judged = judge(groups, usual, options.run, options.seed, model, mass_kg, copies, known)
    found = score_folders(judged, read_labels(labels), elsewhere)
    show_folders(options, found)
    screen: list[Grid | str] = [] if options.verbose else [
        Grid.plain(f"Folders diagnosed blind, {data_word(options)} data", HEADS[:5], [row[:5] for row in rows(found)]),
        *sentences(found)[:8]]
    if options.out is not None:
        write_steady_page({**judged.verdicts, **{LEAVE_ONE_OUT + n: v for n, v in judged.alarms.items()}},
                          options.out / "report.html", options.synthetic, sentences(found), (HEADS, rows(found)),
                          to_json(found.summary.dose.all_motors))
        close(options, "", "see the verdicts", *shown_page(options.out / "report.html"), screen=screen)
    else:
        close(options, "", "the verdicts as a page", *again("--out", "proof"), screen=screen)
    return found


def _close(options: Options, right: int, cases: int, false_names: int, screen: Sequence[Grid]) -> None:
    close(options, proof_sentence(right, cases, false_names),
          "other cases", *again("--seed", options.seed + 1), screen=[] if options.verbose else screen)


def show_proof(options: Options, found: Proof, word: str) -> None:
    """Tables to read: kinds, sizes, terms, concealed against identified effects, confidence."""
    summary, details = found.summary, found.summary.details
    kinds = rich_table(f"Blind proof: {word} data, {summary.cases} cases [exact 95 % intervals]", ("kind",),
                       wrapped=("cases", "right", "false names", "outcomes"))
    for kind, row in summary.by_kind.items():
        kinds.add_row(kind, str(row.n), share_text(row), share_text(row.false_names),
                      ", ".join(f"{name} {count}" for name, count in row.outcomes.items()))
    for engine, flown in summary.by_engine.items():
        kinds.add_row(f"flown by {engine}", str(flown.n), share_text(flown), share_text(flown.false_names), "")
    kinds.add_row("all", str(summary.cases), "", share_text(details.false_name_rate), "")
    options.detail(kinds)
    figures = rich_table(f"What the verdicts are worth ({word})", ("figure",), wrapped=("", "n"))
    for size, recall in details.recall_by_size.items():
        quiet = f", {recall.below_power} of them rightly below the stated size" if recall.below_power else ""
        figures.add_row(f"{size} single effects identified", share_text(recall) + quiet, str(recall.n))
    for name, share in (("both of a pair identified", summary.pairs.both),
                        ('"unknown" and no name on foreign effects', details.unknown_on_foreign),
                        ("95 % intervals that hold the true value", details.coverage95),
                        ("right names that are the term itself", summary.classes.exactly),
                        ("verdicts that abstain though a term is concealed", summary.abstained)):
        figures.add_row(name, share_text(share), str(share.n))
    for name, spread, digits in (("share of the achievable improvement, median", details.share_of_achievable, 2),
                                 ("seconds a diagnosis takes, median", summary.run_time_s, 0)):
        if spread.n:
            figures.add_row(name, f"{spread.median:.{digits}f} ({spread.p10:.{digits}f} .. {spread.p90:.{digits}f} "
                                  "from 10 to 90 % of cases)", str(spread.n))
    options.detail(figures)
    options.detail(_power_table(found.power, word))
    _show_confusion(options, summary.confusion, word)
    _show_calibration(options, summary.calibration, word)
    for case in found.cases:
        if case.false_name:
            options.detail(f"false name in {case.case} ({case.kind}): {one_line(', '.join(case.truth)) or 'nothing'}"
                         f" was there, {one_line(', '.join(case.named))} was named")


def show_real(options: Options, found: RealProof) -> None:
    """One row per kind of ignorance, then the cases."""
    word = data_word(options)
    table = rich_table(f"Knowledge taken from a fitted simulator: {word} recordings, {len(found.train)} flights train, "
                       "others are diagnosed [exact 95 % intervals]", ("taken away",),
                       wrapped=("cases", "named", "false names beside", "verdicts"))
    for kind, row in found.summary.by_kind.items():
        mine = [c for c in found.cases if c.kind == kind]
        beside = sum(bool(c.beside) for c in mine)
        said = "; ".join(", ".join(c.named) or c.outcome for c in mine)
        # in the control nothing is to be named
        table.add_row(kind, str(row.n), "-" if kind == "control" else share_text(row),
                      f"{row.false_names.right} ({beside} not in the control)" if kind != "control" else
                      str(row.false_names.right), one_line(said))
    options.detail(table)
    _show_confusion(options, found.summary.confusion, word)


def _power_table(power: Mapping[str, TermPower], word: str) -> Table:
    table = rich_table(f"Identified single effects by size ({word}); below: rightly not identified, below the stated "
                       "size", ("term",), wrapped=("small", "medium", "large", "smallest detectable, as stated"))
    for term, row in power.items():
        cells = ["-" if found is None else f"{found.named} of {found.n}"
                 + (f", {found.below_power} below" if found.below_power else "")
                 for found in (row.small, row.medium, row.large)]
        least = row.minimum_detectable
        table.add_row(term, *cells, "-" if least is None else f"{least:.2g} {row.unit}")
    return table


def _show_confusion(options: Options, confusion: Mapping[str, Mapping[str, int]], word: str) -> None:
    table = rich_table(f"Concealed and named ({word})", ("truth",), wrapped=("verdict",))
    for there, said in confusion.items():
        table.add_row(there, ", ".join(f"{one_line(name)} {count}" for name, count in said.items()))
    options.detail(table)


def _show_calibration(options: Options, calibration: Sequence[Sequence[float]], word: str) -> None:
    if not calibration:
        return
    table = rich_table(f"Confidence ({word})", ("stated",), wrapped=("right", "findings"))
    for stated, right, n in calibration:
        table.add_row(f"{stated:.0%}", f"{right:.0%}", str(n))
    options.detail(table)


def share_text(found: Share) -> str:
    """``12 of 15, 80 % [52, 96]``; ``-`` for no case."""
    if found.ci95 is None:
        return "-"
    low, high = found.ci95
    return f"{found.right} of {found.n}, {found.share:.0%} [{100 * low:.0f}, {100 * high:.0f}]"

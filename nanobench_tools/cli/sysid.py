"""``nanobench sysid``: scores of predictive models (Task 1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import UsageError
from ..pages.sysid_tables import sysid_screen, vehicle_tables
from ..physics import Vehicle
from ..physics.vehicle import sized
from ..results.result import to_json
from ..steps.named_methods import load_methods
from ..steps.options import Options
from ..steps.result_bodies import ClockModels, SysidBody
from ..steps.sentences import predicted
from ..steps.show import data_word, rich_table, sessions_text, show_left_out, show_ratios
from ..tables.method_names import fit_in_words, quoted
from ..time_offsets.moving.votes import AS_RECORDED, evidence_of
from .closing import close, close_scores, same
from .shared_options import PATH, no_paths_beside, shared_options
from .sysid_models import SIMULATOR, TRIMMED, Choice, Fits, choose, exported, fitted
from .sysid_rows import rows_of

if TYPE_CHECKING:
    from identification.vehicle.vehicle_priors import PriorsFile

    from ..auditing.recording_audit import Audit
    from ..flight import Flight
    from ..protocols.task1 import PredictionRow, Split

DEFAULT_METHODS = ("naive", "published_physics", "published_physics_ratio2")
STARTS_SENTENCE = ("Starts: centred has the stored velocity, which uses poses 50 ms ahead, and rows that the recorder "
                   "interpolated up to the next packet. Past has a velocity of poses up to the start. It also uses "
                   "gyro and onboard attitude of the newest row that had surely arrived, on the clock they were "
                   "recorded on.")
SHOWN = (("position_mae_m", "position m"), ("velocity_mae_m_s", "velocity m/s"), ("attitude_mae_rad", "attitude rad"),
         ("rate_mae_rad_s", "rate rad/s"))


@click.command()
@shared_options()
@click.option("--method", "methods", multiple=True, metavar="NAME|module:Class",
              help="Predictor to score in addition to the default ones; may repeat.")
@click.option("--only", is_flag=True, help="Score only the predictors of --method and those that --fit fits.")
@click.option("--train", multiple=True, type=PATH, metavar="PATH", help="Train on these recordings (with --test).")
@click.option("--test", multiple=True, type=PATH, metavar="PATH", help="Test on these recordings (with --train).")
@click.option("--fit", "wanted", type=click.Choice(["all", "short", "none"]), default="all", show_default=True,
              help="Models to fit on the training flights: the whole ablation, its main rows, or none.")
@click.option("--mass", "mass_kg", type=float, default=0.04085, show_default=True, metavar="KG",
              help="Mass of the vehicle.")
@click.option("--arm", "arm_m", type=float, metavar="M",
              help="From the centre of the vehicle to each motor.  [default: 0.046]")
@click.option("--priors", type=click.Path(path_type=Path), metavar="FILE",
              help="Prior knowledge of your own vehicle, in the form of identification/vehicle/priors.toml.")
@click.option("--learned", type=click.Choice(["all", "own"]),
              help="Train and score learned rows too: published networks and networks on the fitted physics, or these "
                   "(own) alone.")
@click.option("--epochs", type=click.IntRange(min=1), default=500, show_default=True,
              help="Of the published networks.")
@click.option("--train-trajectory", "train_family", metavar="NAME",
              help="Train on the recordings of this trajectory, test on all others.")
def sysid(options: Options, methods: tuple[str, ...], only: bool, train: tuple[Path, ...], test: tuple[Path, ...],
          wanted: str, mass_kg: float, arm_m: float | None, priors: Path | None,
          learned: str | None, epochs: int, train_family: str | None) -> int:
    """Task 1: what will it do? Errors of predictive models over 1 to 50 steps of 10 ms.

    Windows start every 10 rows of clean flight. The default split trains on the earliest flight of each trajectory of
    five families and tests on the others, seen and unseen families apart. Models of physical terms are fitted to the
    training flights, one effect more at a time. The physical vehicle is written as simulator.toml into --out; the model
    that predicts best need not be a vehicle, and both have rows.
    """
    if learned:
        from identification.learned.libraries import share_process

        share_process()
    if bool(train) != bool(test):
        raise UsageError("--train and --test go together; recordings given as PATH are divided")
    if train:
        no_paths_beside(options, "--train")
    if train and train_family:
        raise UsageError("--train and --train-trajectory both choose what trains; give one")
    vehicle = sized(mass_kg, arm_m)
    if only and not methods:
        raise UsageError("--only goes with --method")
    from ..protocols.task1 import JUDGED

    known = None
    if priors is not None:
        from identification.vehicle.vehicle_priors import PriorsFile, priors_of

        known = PriorsFile.read(priors)
        priors_of(vehicle, known)  # report an invalid one before anything is read
    predictors = load_methods("predictors", (*(() if only else DEFAULT_METHODS), *methods))
    flights = options.load([*train, *test] if train else None)
    audits, _ = options.audit(flights)
    recorded = None if options.clock == AS_RECORDED else flights
    flights, audits = options.on_clock(flights, audits, JUDGED)
    parts = None
    if train:
        inside = [any(Path(f.provenance.path).is_relative_to(place) for place in train) for f in flights]
        parts = ([f for f, known in zip(flights, inside, strict=True) if known],
                 [f for f, known in zip(flights, inside, strict=True) if not known])
    if train_family:
        from identification.learned.learned_study import family_parts

        parts = family_parts(flights, train_family)
    body = sysid_body(options, flights, audits, predictors, parts, wanted, vehicle,
                      epochs=epochs if learned else None, published=learned != "own", recorded=recorded, priors=known)
    found, note = to_json(body), body.models.simulator_note
    table, parameters = sysid_screen(found, options.synthetic), vehicle_tables(found)
    share = roll_share(body.rows, body.models.best)
    weaker = "" if share is None else (f"The response of the first model to a roll command is {share:.2f} of that of "
                                       f"{SIMULATOR}.")
    screen = [table, *parameters[:1], *filter(None, [weaker])]
    detail = [table, f"Split: {body.split}.", *parameters, *filter(None, [note])]
    if options.out is not None and body.models.simulator is not None:
        options.data = tuple(test) or options.data
        close(options, predicted(body), "where this model is wrong", "nanobench", "diagnose", *same(options),
              "--simulator", body.models.simulator, screen=screen, detail=detail)
    else:
        close_scores(options, predicted(body), "predictor", screen, detail, bool(methods))
    return options.finish("sysid", body)


def sysid_body(options: Options, flights: Sequence[Flight], audits: Mapping[str, Audit],
               predictors: Sequence[Any] | None = None,
               parts: tuple[Sequence[Flight], Sequence[Flight]] | None = None, wanted: str = "short",
               vehicle: Vehicle | None = None, simulator: str = SIMULATOR, epochs: int | None = None,
               published: bool = True, recorded: Sequence[Flight] | None = None,
               priors: PriorsFile | None = None) -> SysidBody:
    """sysid.json, with the table shown; ``parts`` (train, test) replaces the split; ``wanted``: which
    models to fit (``all``, ``short``, ``none``); ``vehicle``: mass and geometry; ``simulator``: name of the file of the
    best fit; ``epochs``: of the learned rows, None for no such rows; ``published``: the published ones too;
    ``recorded``: the flights on the clock they were recorded on, where ``flights`` have another; ``priors``: the
    user's, of the vehicle."""
    from ..auditing.verb_needs import SYSID
    from ..harness import make_item
    from ..protocols import compare, response, task1
    from ..protocols.completed import completed
    from ..protocols.sessions import parameters_note

    predictors = load_methods("predictors", DEFAULT_METHODS) if predictors is None else predictors
    vehicle = vehicle or Vehicle()
    flights = completed(flights)
    by_name = {flight.name: flight for flight in flights}
    if parts is not None:
        parts = [by_name[f.name] for f in parts[0]], [by_name[f.name] for f in parts[1]]
    chosen = task1.split(flights, audits) if parts is None else task1.given_split(*parts, audits)
    if recorded is not None:
        chosen = chosen.as_recorded(completed(recorded))
    fits, held_out = fitted(options, chosen.train, wanted, vehicle, priors)
    choice = choose(options, chosen.train, predictors, fits, held_out)
    written = exported(options, fits, choice.exported, simulator)
    predictors = [*predictors, *(predictor for predictor, _ in fits.values()), *written.predictors]
    learned: list[Any] = []
    if epochs is not None:
        from .sysid_learned import learned_predictors

        learned = learned_predictors(options, chosen.train, {name: p for name, (p, _) in fits.items()}, epochs, vehicle,
                                     published)
        predictors = [*predictors, *learned]
    rows, scored = rows_of(options, predictors, fits, chosen.test, choice.best)
    response_items = [make_item(response.command_response, {"cases": response.few(chosen.test), "predictor": predictor},
                       f"{predictor.name}, answer to commands", file=chosen.test[0].flight.provenance.path)
             for predictor in predictors]
    answers = options.run(response_items, "commands").values
    answered = {p.name: answers[item.key] for p, item in zip(predictors, response_items, strict=True)
                if item.key in answers}
    notes: dict[str, task1.Fitted | task1.Exported] = {
        name: task1.Fitted(fit.result.trouble, fit.uses, list(fit.result.nuisances)) for name, (_, fit) in fits.items()}
    notes[SIMULATOR] = task1.Exported(
        f"{choice.exported} as exported: one constant vehicle, inputs and start state alone")
    notes[TRIMMED] = task1.Exported(
        f"{choice.exported} as exported, with four gains of the motors from the rows before each start")
    evidence = evidence_of(flights)
    rows = [replace(row, clock=options.clock, clock_evidence=evidence, fit=notes.get(row.model),
                    command_response=answered.get(row.model) if (row.group, row.start) == ("all", "centred") else None)
            for row in rows]
    if learned:
        from .sysid_learned import draw

        draw(options, rows, learned, predictors, chosen.test)
    _show(options, rows, chosen)
    _show_commands(options, rows)
    _show_fits(options, fits, choice)
    note = parameters_note(options.sessions.labels(case.flight for case in chosen.train)) if fits else ""
    if note:
        options.detail(note)
    models = ClockModels(
        choice.best, choice.chosen_on([p.name for p in learned if p.information == "state"]),
        {p.name: p.parameters for p in predictors if hasattr(p, "parameters") and p.name != SIMULATOR
         and not (p.name in fits and fits[p.name][1].result.trouble)},
        written.path, "" if choice.exported is None else " ".join(filter(None, (
            trade(rows, choice.exported, choice.best), fits[choice.exported][1].simulator_note))),
        {name: value.result for name, (_, value) in fits.items()})
    train, test = ([case.flight.name for case in cases] for cases in (chosen.train, chosen.test))
    return SysidBody(rows, compare.flight_means(scored, options.clock), note, models, chosen.note, train, test,
                     show_left_out(options, flights, [*train, *test], audits, SYSID, chosen.left_out),
                     None if epochs is None else {p.name: p.trained for p in learned})


def _show_fits(options: Options, fits: Fits, choice: Choice) -> None:
    from rich.markup import escape

    best = choice.best
    for name, (_, value) in fits.items():
        if trouble := value.result.trouble:
            options.detail(f"{name} is no result: {escape(trouble)}")
    if best is not None:
        options.detail(f"Best of class state: {escape(best)}" + (f" ({fits[best][1].uses})" if best in fits else "")
                     + f". Chosen on {escape(choice.chosen_on().how)}.")
    if best is not None and best in fits:
        options.detail(escape(fits[best][1].summary))
    if choice.exported is not None and choice.exported != best:
        options.detail(escape(fits[choice.exported][1].summary))
    if choice.exported is not None:
        options.detail(escape(" ".join(filter(None, (f"The row {SIMULATOR} is {choice.exported} as it is exported, "
                                                     "read back and judged alone.",
                                                   fits[choice.exported][1].simulator_note)))))


def trade(rows: Sequence[PredictionRow], exported: str, best: str | None) -> str:
    """By how much the exported vehicle and the best predictor differ after half a second; empty without both rows."""
    found = {row.model: row for row in rows if (row.group, row.truth, row.start) == ("all", "onboard", "centred")}
    if exported == best or best not in found or SIMULATOR not in found:
        return ""

    def errors(model: str) -> str:
        metrics = found[model].metrics
        return ", ".join(f"{metrics[name]['50']:.3g} {heading.partition(' ')[2]}" for name, heading in SHOWN)

    share = roll_share(rows, best)
    weaker = "" if share is None else f"; its response to a roll command is {share:.2f} of the vehicle's"
    name = quoted(fit_in_words(best))
    return (f"simulator.toml is a physical vehicle: off by {errors(SIMULATOR)} after half a second without a "
            f"controller. {name} predicted the training flights best ({errors(best)}){weaker}.")


def roll_share(rows: Sequence[PredictionRow], best: str | None) -> float | None:
    """Response of the best predictor to a roll command over that of the exported vehicle; None where one is unknown."""
    from ..protocols.response import SHOWN_S

    found = {row.model: row.command_response for row in rows
             if (row.group, row.truth, row.start) == ("all", "onboard", "centred")}
    answers = [found.get(str(name)) for name in (best, SIMULATOR)]
    if best == SIMULATOR or any(answer is None for answer in answers):
        return None
    mine, vehicles = (answer.roll.after_s[SHOWN_S].answer for answer in answers if answer is not None)
    return mine / vehicles if vehicles else None


def _show(options: Options, rows: Sequence[PredictionRow], chosen: Split) -> None:
    from rich.markup import escape

    from ..protocols.sessions import interval_note

    title = (f"Task 1: {data_word(options)} data, clock {options.clock}; mean error after 1, 10, 50 steps of 10 ms; "
             "sum over 1..50 \\[95 % interval]")
    table = rich_table(title)
    for head in ("model", "information", "truth", "start", "group", "windows", "flights", "sessions"):
        table.add_column(head, no_wrap=head != "model", overflow="fold")  # two names may begin alike
    for _, heading in SHOWN:
        table.add_column(heading, justify="right")
    for row in rows:
        if row.group not in (("all", "seen", "unseen") if row.start == "centred" else ("all",)):
            continue
        name = row.model + " (no result)" * bool(row.trouble)
        labels = [name, row.information, row.truth, row.start, row.group]
        counts = (str(row.n_windows), str(row.n_flights), sessions_text(row.drawn.sessions))
        table.add_row(*map(escape, labels), *counts, *(_cell(row.metrics[m], row.ci95[m]) for m, _ in SHOWN))
        if row.published is not None:
            table.add_row(escape(row.model), "", "", "", "(published)", "", "", "",
                          *(_cell(row.published.published[m], {}) for m, _ in SHOWN))
    options.detail(table)
    options.detail(interval_note(rows))
    show_ratios(options, [(f"{row.model}, {row.truth}", row.ratios) for row in rows if row.group == "all"],
                [(metric, heading, 1.0, 2) for metric, heading in SHOWN], "sum")
    options.detail(STARTS_SENTENCE)
    options.detail(f"Split: {chosen.note}. {len(chosen.train)} flights train, {len(chosen.test)} test.")


def _show_commands(options: Options, rows: Sequence[PredictionRow]) -> None:
    from rich.markup import escape

    from ..protocols.response import MIX, SHOWN_S

    found = {row.model: row.command_response for row in rows if row.command_response is not None}
    if not found:
        return
    one = next(iter(found.values()))
    table = rich_table(f"Change {SHOWN_S} s after a step of {one.step:g} of PWM, {data_word(options)} "
                       f"data, {one.windows} windows. After x: ratio to a rigid body with numbers from firmware, scale "
                       "and ruler", wrapped=("model",))
    for name in MIX:
        table.add_column(f"{name} {getattr(one, name).after_s[SHOWN_S].unit}", justify="right", no_wrap=True)
    table.add_column("is it a vehicle?")
    for model, answer in found.items():
        cells = [f"{one.after_s[SHOWN_S].answer:+.4f} x {one.ratio:.3f}" + " WRONG" * (one.sign == "wrong")
                 for one in (getattr(answer, name) for name in MIX)]
        table.add_row(escape(model), *cells, answer.vehicle or "signs are right")
    options.detail(table)


def _cell(found: Mapping[str, float], ci95: Mapping[str, Any]) -> str:
    text = " ".join(f"{found[h]:.4f}" for h in ("1", "10", "50") if h in found)
    if "sum" in found:
        text += f" Σ {found['sum']:.2f}"
    if interval := ci95.get("sum"):
        text += f" \\[{interval[0]:.2f}, {interval[1]:.2f}]"
    return text

"""What ``nanobench sysid --learned all`` trains: predictors for the same windows as all rows."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from nanobench_tools.errors import InputError, NanobenchError
from nanobench_tools.flight import Flight
from nanobench_tools.methods import Predictor
from nanobench_tools.protocols.task1 import Case
from nanobench_tools.sources.labels import family_of

from .own import SETTINGS, held_out, lesson
from .published_networks import KINDS, predictor_of, row_name, train_network
from .together import Work, train_together
from .training import Settings, Trained
from .training_rows import Rows, rows_of

OWN = {"physics_network": "fit_balanced", "physics_network_past": "fit_observed"}
"""Our rows -> the physics that each corrects."""
LENGTHS = {"residual_mlp": 1, "physics_residual": 2, "lstm": 3}
"""How long the published ones take, in order; the longest is trained first, so that no core waits for it at the end."""


@dataclass(frozen=True)
class Wanted:
    """published: the published rows, of so many epochs; voltage: each of them also with the battery as an input; own:
    our rows too."""

    epochs: int = 500
    published: bool = True
    voltage: bool = True
    own: bool = True
    seed: int = 0


def family_parts(flights: Sequence[Flight], family: str) -> tuple[list[Flight], list[Flight]]:
    """(flights of ``family``, all others). InputError if it is missing."""
    inside = [family_of(flight) == family for flight in flights]
    if not any(inside):
        known = ", ".join(sorted({family_of(flight) for flight in flights}))
        raise InputError("--train-trajectory", f"no recording of {family!r}", f"families there are: {known}")
    return ([f for f, mine in zip(flights, inside, strict=True) if mine],
            [f for f, mine in zip(flights, inside, strict=True) if not mine])


Fits = Callable[[str, Sequence[Sequence[Case]]], Sequence[Predictor]]
"""A rung fitted to each of some sets of flights."""


def trained_rows(cases: Sequence[Case], wanted: Wanted, folder: Path, physics: Mapping[str, Predictor], fits: Fits,
                 quiet: bool = False, say: Callable[[str], None] = print,
                 jobs: int = 1) -> tuple[list[Any], list[dict[str, str]]]:
    """(predictors, failures [{item, file, error}]): the published rows, then ours on ``physics`` (by name of the rung)
    where it is there; ``fits`` fits it to other flights. What cannot be trained is a failure, never a row. ``jobs``
    networks are trained at a time; the number does not change the result.

    Raises InputError when nothing is left to train on.
    """
    if not cases:
        raise InputError("training flights", "none is left after the audit", "give others with --train")
    rows = rows_of(cases)
    settings = Settings(epochs=wanted.epochs, seed=wanted.seed)
    failures: dict[str, str] = {}
    planned: dict[str, Planned] = {}
    for voltage in (False, True) if wanted.voltage else (False,):
        planned |= {row_name(kind, voltage): _published(kind, voltage, rows, settings, folder)
                    for kind in (KINDS if wanted.published else ())}
    for name, rung in (OWN if wanted.own else {}).items():
        if rung not in physics:
            continue
        try:
            planned[name] = _own(name, rung, cases, physics[rung], fits, folder, wanted.seed)
        except NanobenchError as error:
            failures[name] = str(error)
    work = [one for row in sorted(planned.values(), key=lambda row: -row.length) for one in row.work]
    trained, errors = train_together(work, jobs, quiet)
    found = []
    for name, row in planned.items():
        if broken := [errors[one.label] for one in row.work if one.label in errors]:
            failures[name] = broken[0]
            continue
        mine = [trained[one.label] for one in row.work]
        try:
            found.append(row.row(mine))
        except NanobenchError as error:
            failures[name] = str(error)
            continue
        say(f"{name}: {found[-1].trained.epochs} epochs, {sum(one.seconds for one in mine):.0f} s of training in "
            f"this run, {sum(one.processor_s for one in mine):.0f} s of processor time")
    place = cases[0].flight.provenance.path
    return found, [{"item": f"train {name}", "file": place, "error": error} for name, error in failures.items()]


@dataclass(frozen=True)
class Planned:
    """A row to come: its trainings, and what makes the row of them. length: of one of them, in any unit."""

    work: Sequence[Work]
    row: Callable[[Sequence[Trained]], Any]
    length: int


def _published(kind: str, voltage: bool, rows: Rows, settings: Settings, folder: Path) -> Planned:
    name = row_name(kind, voltage)
    one = Work(name, train_network, {"kind": kind, "voltage": voltage, "rows": rows, "settings": settings,
                                     "folder": folder}, settings.epochs)
    return Planned([one], lambda found: predictor_of(kind, voltage, rows, found[0]), LENGTHS[kind])


def _own(name: str, rung: str, cases: Sequence[Case], base: Predictor, fits: Fits, folder: Path,
         seed: int) -> Planned:
    past = base.information == "past"
    taught = lesson(name, held_out(cases, lambda sets: fits(rung, sets), past), past)
    return Planned(taught.work(replace(SETTINGS, seed=seed), folder), lambda found: taught.row(base, found), 0)

"""What ``nanobench sysid --methods learned`` trains: predictors for the same windows as all rows."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from nanobench_tools.errors import InputError, NanobenchError
from nanobench_tools.flight import Flight
from nanobench_tools.methods import Predictor
from nanobench_tools.protocols.labels import family_of
from nanobench_tools.protocols.task1 import Case

from .own import SETTINGS, Corrected, held_out, train_own
from .published import KINDS, LearnedPredictor, row_name, train_row
from .rows import Rows, rows_of
from .training import Settings

OWN = {"physics_network": "fit_balanced", "physics_network_past": "fit_observed"}
"""Our rows -> the physics that each corrects."""


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
    """(flights of ``family``, all others). InputError when there is none."""
    inside = [family_of(flight) == family for flight in flights]
    if not any(inside):
        known = ", ".join(sorted({family_of(flight) for flight in flights}))
        raise InputError("--train-family", f"no recording of {family!r}", f"families there are: {known}")
    return ([f for f, mine in zip(flights, inside, strict=True) if mine],
            [f for f, mine in zip(flights, inside, strict=True) if not mine])


def trained_rows(cases: Sequence[Case], wanted: Wanted, folder: Path, physics: Mapping[str, Predictor],
                 fit: Callable[[str, Sequence[Case]], Predictor], quiet: bool = False,
                 say: Callable[[str], None] = print) -> tuple[list[Any], list[dict[str, str]]]:
    """(predictors, failures [{item, file, error}]): the published rows, then ours on ``physics`` (by name of the rung)
    where it is there; ``fit(rung, cases)`` fits it to other flights. What cannot be trained is a failure, never a row.

    Raises InputError when nothing is left to train on.
    """
    if not cases:
        raise InputError("training flights", "none is left after the audit", "give others with --train")
    rows = rows_of(cases)
    settings = Settings(epochs=wanted.epochs, seed=wanted.seed)
    jobs: list[tuple[str, Callable[[], tuple[Any, float]]]] = [
        (row_name(kind, voltage), functools.partial(_published, kind, voltage, rows, settings, folder, quiet))
        for voltage in ((False, True) if wanted.voltage else (False,)) for kind in (KINDS if wanted.published else ())]
    if wanted.own:
        jobs += [(name, functools.partial(_own, name, rung, cases, physics[rung], fit, folder, wanted.seed, quiet))
                 for name, rung in OWN.items() if rung in physics]
    found, failed = [], []
    for name, job in jobs:
        try:
            made, seconds = job()
        except NanobenchError as error:
            failed.append({"item": f"train {name}", "file": cases[0].flight.provenance.path, "error": str(error)})
            continue
        found.append(made)
        say(f"{name}: {made.trained['epochs']} epochs, {seconds:.0f} s of training in this run")
    return found, failed


def _published(kind: str, voltage: bool, rows: Rows, settings: Settings, folder: Path,
               quiet: bool) -> tuple[LearnedPredictor, float]:
    made, found = train_row(kind, voltage, rows, settings, folder, quiet)
    return made, found.seconds


def _own(name: str, rung: str, cases: Sequence[Case], base: Predictor, fit: Callable[[str, Sequence[Case]], Predictor],
         folder: Path, seed: int, quiet: bool) -> tuple[Corrected, float]:
    past = base.information == "past"
    groups = held_out(cases, lambda rest: fit(rung, rest), past)
    return train_own(name, base, groups, past, replace(SETTINGS, seed=seed), folder, quiet)

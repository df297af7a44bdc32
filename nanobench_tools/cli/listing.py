"""``nanobench VERB --list``: the names a verb takes, those of other packages too, each with a sentence."""

import inspect
import re
import sys
from collections.abc import Callable, Mapping
from typing import Any

import click

from ..errors import MissingExtraError

Names = Mapping[str, str]
"""Name -> its sentence."""

TASK3 = {
    "as-published": "The published table with its faults, digit by digit.",
    "as-published-corrected": "The recordings of the published table, with their faults mended.",
    "clean": "Every distinct flight, faults cut; the motion capture only judges.",
    "aided": "Few, late and noisy poses all along: --pose-rate, --pose-delay, --pose-noise, --pose-loss.",
    "blackout": "Poses until t0 and none afterwards; scored 1, 5, 10 and 20 s later.",
    "whole-flight": "No pose after take-off."}
TASK2 = {"as-published": "The published pair of rows with its faults.",
         "clean": "The phase in which a path was streamed, by family, speed and controller."}
PLANTS = {"real": "The logged flights.", "gate": "Held-out flights flown again on the plant, against their logs.",
          "simulated": "An ensemble of plants that the vehicle may be.",
          "mismatch": "Plants unlike what controllers assume."}
KINDS = {"null": "Nothing is concealed.", "single": "One effect is concealed.", "pair": "Two effects are concealed.",
         "twin": "One effect that is easily confused with another.", "change": "An effect from one flight on.",
         "fault": "The data are wrong, not the simulator.", "foreign": "Physics that no term describes."}
TARGETS = {"nanobench": "Recordings as CSV with its sheet.", "parquet": "Recordings, a file per stream, SI units.",
           "tum": "The motion-capture trajectory of recordings.",
           "euroc": "The same as a table of truth in the layout of EuRoC.",
           "kitti": "The same as poses of KITTI's tools, with their times next to them.",
           "rpg": "The same, and the onboard estimate, as a folder for rpg_trajectory_evaluation.",
           "rrd": "Recordings for the Rerun viewer, with what the audit found.",
           "rotorpy": "simulator.toml for RotorPy.", "crazyflow": "simulator.toml for Crazyflow and drone-models.",
           "urdf": "simulator.toml for gym-pybullet-drones.", "c": "simulator.toml as C code.",
           "casadi": "simulator.toml as CasADi functions.", "all-simulators": "All of the simulators at once."}
OWN = {"estimators": "estimator", "predictors": "predictor", "controllers": "controller"}
"""Registry group -> what ``nanobench new`` calls one of it."""


def first_sentence(found: Any) -> str:
    """The first sentence of a class or function; of its module if it has no docstring."""
    own = found.__doc__ if isinstance(found, type) else inspect.getdoc(found)
    text = " ".join((own or sys.modules[found.__module__].__doc__ or "").replace("``", "").split())
    return shortened(text)


def shortened(text: str) -> str:
    """The first sentence, up to a semicolon.

    >>> shortened("Stays where it was (Busetto et al. 2025); no model. And more.")
    'Stays where it was (Busetto et al. 2025).'
    """
    return re.split(r"(?<=[.!?])\s+(?=[A-Z\"])|; ", text, maxsplit=1)[0].rstrip(".:") + "."


def registered(group: str) -> Names:
    """Methods of a group; of one that needs what is not installed it says how to get it."""
    from ..lookup.registry import load, names

    found = {}
    for name in names(group):
        try:
            found[name] = first_sentence(load(group, name))
        except MissingExtraError as error:
            found[name] = str(error)
        except Exception as error:  # a package of somebody else
            found[name] = f"cannot be loaded: {type(error).__name__}: {error}"
    return found


def trajectories() -> Names:
    from ..practice.references import FAMILIES

    return {name: first_sentence(family.path) for name, family in FAMILIES.items()}


def terms() -> Names:
    from ..lookup.registry import load_all

    return {name: shortened(term.sentence) for name, term in load_all("terms").items()}


def faults() -> Names:
    from ..auditing.faults.kinds import kinds

    return {name: shortened(" ".join(kind.doc.replace("``", "").split()).removeprefix(f"{name}: "))
            for name, kind in kinds().items()}


def methods(group: str) -> Callable[[], Names]:
    return lambda: registered(group)


LISTS: dict[str, dict[str, Callable[[], Names]]] = {
    "audit": {"faults": faults},
    "control": {"--plant": lambda: PLANTS, "--protocol": lambda: TASK2, "--controller": methods("controllers"),
                "--trajectory": trajectories},
    "convert": {"--to": lambda: TARGETS},
    "diagnose": {"terms": terms, "--simulator": methods("simulators")},
    "estimate": {"--protocol": lambda: TASK3, "--method": methods("estimators")},
    "fly": {"--controller": methods("controllers"), "--trajectory": trajectories},
    "prove": {"--kind": lambda: KINDS},
    "simulate": {"--controller": methods("controllers"), "--trajectory": trajectories},
    "sysid": {"--method": methods("predictors"), "terms": terms},
    "tune": {"--controller": methods("controllers"), "--trajectory": trajectories}}
"""Verb -> what it takes names for -> the names."""


def show_lists(verb: str, verbose: bool = False) -> None:
    """Prints the names of a verb, each with its sentence; the names alone where these do not fit one screen."""
    from ..steps.options import Options, one_line, screen_height, screen_width
    from ..tables.result_table import Table
    from ..tables.terminal import lines_of
    from .closing import PROMPT, close

    options = Options(verbose=verbose)
    found = {what: names() for what, names in LISTS[verb].items()}
    tables = [Table.plain(what, ("", ""), [("  " + one_line(name), one_line(text)) for name, text in names.items()])
              for what, names in found.items()]
    lines = sum(len(lines_of(table, screen_width())) for table in tables)
    if verbose or lines <= screen_height() - PROMPT:
        for table in tables:
            options.show(table)
        return
    names_alone = [Table.plain("", ("", ""), [(what, one_line(", ".join(names))) for what, names in found.items()])]
    close(options, "", "with a sentence each", "nanobench", verb, "--list", "--verbose", screen=names_alone)


def list_option(verb: str) -> click.Option:
    """``--list`` of a verb: prints and ends, and ignores all other options but ``--verbose``."""
    from .closing import WORDS

    def shown(context: click.Context, parameter: click.Parameter, wanted: bool) -> None:
        if wanted and not context.resilient_parsing:
            show_lists(verb, "--verbose" in context.meta.get(WORDS, ()))
            context.exit()

    return click.Option(["--list"], is_flag=True, is_eager=True, expose_value=False, callback=shown,
                        help=f"The names there are for {', '.join(LISTS[verb])}, with --verbose each with a sentence.")

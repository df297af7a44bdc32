"""``nanobench run``: the main job, by the same functions as the verbs."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from ..errors import InputError, NanobenchError
from ..protocols.compare import rankings
from ..results.result import Result
from ..steps.options import Options
from ..tables.result_table import Table
from ..time_offsets.moving.votes import CLOCKS
from .audit import audit_body, audit_screen, audit_sentence
from .closing import close, shown_page
from .shared_options import shared_options

OUT = Path("results")
TASKS = {"estimate": "Task 3", "control": "Task 2", "sysid": "Task 1"}
LONGEST = 60
"""Lines of the screen of the main job."""
PRACTICE_SEEDS, PRACTICE_FLIGHTS = 2, 24
"""Practice flights when there are no recordings: every family at three speeds, twice with other vehicles."""


@click.command()
@shared_options("clock")
@click.option("--clock", "clock_name", type=click.Choice(CLOCKS[:-1]),
              help="Clock of the clean rows of all tasks: as-recorded, offset or retimed. Default: as recorded, and "
                   "Task 1, dead reckoning and the logged estimates re-timed too, every row with its clock. The "
                   "published protocols are always as recorded.")
@click.option("--practice", is_flag=True, help="Simulate practice flights (SYNTHETIC) even if there are recordings.")
def run(options: Options, clock_name: str | None, practice: bool) -> int:
    """The main job: audit, the three tasks, tables as CSV and LaTeX, and report.html in --out DIR (./results).

    Reads --data, else the recordings in the default places. Without recordings it simulates practice flights, and
    everything made from them is labelled SYNTHETIC. Started again after an interrupt it goes on where it was. --json
    holds all result files in one: audit, estimate, control, sysid.
    """
    from ..pages.report_page import page_path

    screens: list[Table | str] = []
    results = main_job(options, practice, clock_name, screens)
    page = page_path(options.out or OUT)
    close(options, f"{page}, tables as CSV and LaTeX and all results as JSON in {page.parent}", "see it",
          *shown_page(page), screen=screens, lines=LONGEST)
    if options.json is not None:
        options.write_json(options.envelope("run", results))
    return options.exit_code()


def main_job(options: Options, practice: bool = False, clock: str | None = None,
             screens: list[Table | str] | None = None) -> dict[str, dict[str, Any]]:
    """Does it all and gives the content of the result files by name; ``options.out`` is ./results if not set.

    screens: gets what a terminal shows of each task.

    clock: that of the clean rows; None: see ``Recordings``. A task for which the recordings do not suffice is shown
    with the reason, and the others go on. If no task is possible, the reasons are in ``options.failed``.
    """
    from ..auditing.selection import distinct
    from ..harness import write_json
    from ..pages import write_report
    from ..sources.discover import default_data
    from .run_clocks import COMPARED_CLOCKS, Recordings, control_on, estimate_on, sysid_on

    out = options.out = options.out or OUT
    stages: dict[str, Callable[[Recordings], Result]] = {
        "estimate": estimate_on, "control": control_on, "sysid": sysid_on}
    steps = len(stages) + 3
    if practice or not (options.data or default_data()):
        options.say(f"[1/{steps}] no recordings: practice flights, SYNTHETIC")
        options.data = (simulate(options, out / "practice"),)
    else:
        options.say(f"[1/{steps}] recordings")
    flights = options.load()
    options.say(f"[2/{steps}] audit")
    moved = {flight.name for flight in distinct(flights)[0]} if clock is None else set()
    audits, copies = options.audit(flights, COMPARED_CLOCKS, moved)
    results: dict[str, dict[str, Any]] = {}
    found = audit_body(flights, audits, copies)
    shown: list[Table | str] = [] if screens is None else screens
    shown += [*audit_screen(options, audits, copies)[:1], f"Audit: {audit_sentence(found)}"]

    def keep(name: str, body: Result | Mapping[str, object], failed: list[dict[str, str]]) -> None:
        results[name] = options.envelope(name, body, failed)
        write_json(out / f"{name}.json", results[name])

    keep("audit", found, list(options.failed))
    impossible: list[dict[str, str]] = []
    given = Recordings(options, [flight for flight in flights if flight.name in audits], audits, clock)
    for step, (name, body_of) in enumerate(stages.items(), start=3):
        options.say(f"[{step}/{steps}] {name}")
        before = len(options.failed)
        try:
            body: Result | Mapping[str, object] = body_of(given)
            lacks: list[dict[str, str]] = []
        except InputError as error:
            body, lacks = {"rows": []}, [{"item": name, "file": error.place, "error": str(error)}]
            shown.append(f"{TASKS[name]} ({name}) is not possible: {error.found}"
                         + (f"; {error.advice}" if error.advice else ""))
        except NanobenchError as error:
            body, lacks = {"rows": []}, []
            options.failed.append({"item": name, "file": "", "error": str(error)})
        impossible += lacks
        keep(name, body, [*options.failed[before:], *lacks])
        shown += _screen_of(options, body, results[name])
    if len(impossible) == len(stages):
        options.failed += impossible
    options.say(f"[{steps}/{steps}] report")
    write_report(out, results, flights, audits, options.synthetic)
    return results


def _screen_of(options: Options, body: Result | Mapping[str, object], content: Mapping[str, Any]) -> list[Table | str]:
    """One task on a terminal, its result in a sentence last."""
    from ..pages.sysid_tables import sysid_screen
    from ..pages.task3_tables import task3_screen
    from ..steps.controlling import control_screen
    from ..steps.result_bodies import ControlBody, EstimateBody, SysidBody
    from ..steps.sentences import controlled, estimated, predicted

    label = ", SYNTHETIC" if options.synthetic else ""
    if isinstance(body, EstimateBody):
        recorded = {**content, "rows": [row for row in content["rows"] if row["clock"] == "as-recorded"]}
        said = estimated(body.rows, rankings(body.rows))
        return [*task3_screen(recorded, options.synthetic), f"Task 3{label}. {said}"]
    if isinstance(body, ControlBody):
        return [*control_screen(options, body), f"Task 2{label}. {controlled(body)}"]
    if isinstance(body, SysidBody):
        recorded = {**content, "rows": [row for row in content["rows"] if row["clock"] == content["clock"]]}
        return [sysid_screen(recorded, options.synthetic), f"Task 1{label}. {predicted(body)}"]
    return []


def simulate(options: Options, folder: Path) -> Path:
    """The folder with practice recordings; made once, again when a file is missing or changed."""
    from ..harness import make_item, run_items

    seeds = range(options.seed, options.seed + PRACTICE_SEEDS)
    wanted = [{"folder": folder / f"seed_{seed}", "n": PRACTICE_FLIGHTS, "seed": seed} for seed in seeds]
    items = [make_item(practice_item, kwargs, f"practice flights of seed {kwargs['seed']}") for kwargs in wanted]
    for store in (options.store, None):
        result = run_items(items, store, options.jobs, None, options.progress, "simulate")
        if all(_hashes(made.folder) == made.files for made in result.values.values()):
            break
    options.failed += result.failed
    return folder


@dataclass(frozen=True, repr=False)
class Practised(Result):
    """A folder of practice flights, and the content hashes of its files by name."""

    folder: Path
    files: dict[str, str]


def practice_item(folder: Path, n: int, seed: int) -> Practised:
    """Writes ``n`` practice flights."""
    from ..practice.flights import write_practice

    write_practice(folder, n, seed)
    return Practised(folder, _hashes(folder))


def _hashes(folder: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.glob("*"))}

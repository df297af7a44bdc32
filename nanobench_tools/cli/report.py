"""``nanobench report``: the page again, from the result files of a folder."""

from typing import Any

import click

from ..errors import InputError, UsageError
from ..steps.options import Options
from .closing import close, shown_page
from .shared_options import shared_options


@click.command()
@shared_options("json", "scheduler", "seed", "clock")
def report(options: Options) -> int:
    """One HTML page from the result files of a folder.

    Reads audit.json, estimate.json, sysid.json, thrust.json, control.json and verdict.json in --out (or in the one
    PATH that has some), as far as they are there. Writes report.html, and the tables as CSV and LaTeX into the same
    folder. The pictures of single flights need the recordings that audit.json lists by content. They are read from
    --data, else from the default places; without them the page has no such pictures. Where report.html is the page of
    another verb, such as diagnose, this one is overview.html.
    """
    from ..pages.report_page import RESULTS, write_report
    from ..pages.tiles import tiles
    from ..results.result_files import read_json
    from ..tables.result_table import Table

    folders = [path for path in options.data if any((path / f"{name}.json").is_file() for name in RESULTS)]
    if options.out is None and len(folders) == 1:
        options.out, options.data = folders[0], tuple(path for path in options.data if path != folders[0])
    if options.out is None:
        raise UsageError("report needs --out DIR, the folder that holds the result files")
    if not options.out.is_dir():
        raise InputError(f"--out {options.out}", "is no folder", "give the folder that holds the result files")
    results = {name: read_json(options.out / f"{name}.json", name) for name in RESULTS
               if (options.out / f"{name}.json").exists()}
    if not results:
        raise InputError(f"--out {options.out}", "holds no result file",
                         f"one of {', '.join(f'{name}.json' for name in RESULTS)} is needed; nanobench run writes them")
    flights = recordings(options, results)
    synthetic = any(body.get("synthetic") for body in results.values())
    path = write_report(options.out, results, flights, {}, synthetic)
    drawn = f"pictures of {len(flights)} recording{'s' * (len(flights) != 1)}" if flights else (
        "no pictures of recordings: give --data")
    found = [[tile.title, tile.value, tile.detail] for tile in tiles(results)]
    screen = [Table.plain("What the results say", ("question", "answer", "of"), found)] if found else []
    close(options, f"{path} ({path.stat().st_size / 1e6:.1f} MB, {drawn})", "see it", *shown_page(path),
          screen=screen)
    return options.exit_code()


def recordings(options: Options, results: dict[str, Any]) -> list[Any]:
    """The recordings that audit.json names, found by content hash; none when there are no recordings to look at.

    A name is only a label, so it is the audit's: the same file may be called differently together with other files.
    """
    from dataclasses import replace

    from ..sources.discover import default_data

    audited = [(entry["flight"], entry["sha256"]) for entry in results.get("audit", {}).get("flights", [])]
    if not audited or not (options.data or default_data()):
        return []
    try:
        found = {flight.provenance.sha256: flight for flight in options.load()}
    except InputError as error:
        if options.data:
            raise
        options.say(f"no recordings in the default places, so the page has no pictures of them: {error}")
        return []
    missing = [name for name, sha256 in audited if sha256 not in found]
    if missing:
        options.say(f"{len(missing)} of {len(audited)} recordings of audit.json were not found, {missing[0]} for one; "
                    "the page has no pictures of them")
    return [replace(found[sha256], name=name) for name, sha256 in audited if sha256 in found]

"""``nanobench convert``: recordings into another format."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import UsageError
from .options import Options, shared_options

if TYPE_CHECKING:
    from ..flight import Flight

FORMATS = ("nanobench", "parquet", "tum")


@click.command()
@shared_options("seed", "clock")
@click.option("--to", type=click.Choice(FORMATS), default="nanobench", show_default=True,
              help="CSV with its sheet; a Parquet file per stream, SI units; the mocap trajectory.")
def convert(options: Options, to: str) -> int:
    """Write recordings of any source that is understood in another format, one per recording into --out DIR."""
    from ..harness import make_item, run_items

    if options.out is None:
        raise UsageError("nanobench convert: --out DIR is needed")
    items = [make_item(convert_item, {"flight": flight, "out_dir": options.out, "to": to}, f"convert {flight.name}")
             for flight in options.load()]
    result = run_items(items, None, options.jobs, options.scheduler, options.progress, "convert")
    options.failed += result.failed
    count = len(result.values)
    options.say(f"{count} recording{'s' * (count != 1)} written to {options.out}")
    return options.finish("convert", {"to": to, "files": [value["file"] for value in result.values.values()]})


def convert_item(flight: Flight, out_dir: Path, to: str) -> dict:
    """Writes one recording."""
    from ..export import export

    return {"file": str(export(flight, out_dir, to))}

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
@click.option("--mocap", type=click.Path(path_type=Path), metavar="FILE",
              help="Motion capture of the same flight recorded on a clock of its own (TUM, or any format that is "
                   "understood): its time is found by the turning rates.")
def convert(options: Options, to: str, mocap: Path | None) -> int:
    """Write recordings of any source that is understood in another format, one per recording into --out DIR.

    \b
    nanobench convert --data log.bin --out csv            an onboard log as CSV with its sheet
    nanobench convert --data log.bin --mocap traj.tum --out csv    the same, with its motion capture
    """
    from ..harness import make_item, run_items
    from ..sources import load_recordings

    if options.out is None:
        raise UsageError("nanobench convert: --out DIR is needed")
    flights = options.load()
    if mocap is not None:
        from ..retiming.pairing import with_mocap

        found = load_recordings([mocap]).flights
        if len(found) != 1 or "mocap" not in found[0]:
            raise UsageError(f"nanobench convert: --mocap {mocap}: holds no motion capture" if not found else
                             f"nanobench convert: --mocap {mocap}: holds {len(found)} recordings; give one file")
        flights = [with_mocap(flight, found[0]) for flight in flights]
        for flight in flights:
            options.say(f"{flight.name}: {flight.provenance.notes[-1]}")
    items = [make_item(convert_item, {"flight": flight, "out_dir": options.out, "to": to}, f"convert {flight.name}")
             for flight in flights]
    result = run_items(items, None, options.jobs, options.scheduler, options.progress, "convert")
    options.failed += result.failed
    count = len(result.values)
    options.say(f"{count} recording{'s' * (count != 1)} written to {options.out}")
    return options.finish("convert", {"to": to, "files": [value["file"] for value in result.values.values()]})


def convert_item(flight: Flight, out_dir: Path, to: str) -> dict:
    """Writes one recording."""
    from ..export import export

    return {"file": str(export(flight, out_dir, to))}

"""``nanobench record``: what a vehicle says over its link, kept as it comes and exported to the NanoBench format."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import UsageError
from ..results.result import Result
from ..steps.options import Options
from .closing import close
from .shared_options import PATH, FiniteRange, shared_options

if TYPE_CHECKING:
    from ..radio.record_export import Exported
    from ..radio.recorder import Recorder

EVERY_S = 0.1
"""Interval of echoes while a vehicle is recorded without flying."""


@click.command()
@shared_options("data", "columns", "jobs", "scheduler", "clock", "seed")
@click.option("--uri", metavar="URI", help="Of the vehicle, as radio://0/80/2M/E7E7E7E7E7.")
@click.option("--blocks", type=PATH, metavar="FILE", help="Log blocks (YAML); else NanoBench's signals.")
@click.option("--mocap", metavar="SOURCE", help="simulated, TYPE://HOST/BODY or module:callable.")
@click.option("--seconds", type=FiniteRange(min=1.0), metavar="S", help="Length. Default: until Ctrl-C.")
@click.option("--export", "exported", type=PATH, metavar="FILE",
              help="Export a raw recording, such as a broken one.")
@click.option("--repair", "damaged", type=PATH, metavar="FILE",
              help="Write the whole records of a damaged raw recording to NAME.repaired.packets and export them.")
@click.option("--stamps", type=click.Choice(("aligned", "arrival")), default="aligned", show_default=True,
              help="Times of samples: taken, or their packets' arrival.")
def record(options: Options, uri: str | None, blocks: Path | None, mocap: str | None, seconds: float | None,
           exported: Path | None, damaged: Path | None, stamps: str) -> int:
    """Record a vehicle without flying it: log blocks and poses into --out DIR.

    At the end: a NanoBench CSV with its sheet, and Parquet. A killed recording loses at most 100 ms of its raw packets
    in DIR/.raw.
    """
    if damaged is not None:
        if exported is not None:
            raise UsageError("--repair and --export both read a file; give one")
        exported = _repair(options, damaged)
    if exported is not None:
        if uri or blocks or mocap or seconds:
            raise UsageError("--export and --repair read a file; they go with --out and --stamps alone")
        found = _export(options, exported, stamps)
    else:
        if uri is None or options.out is None:
            raise UsageError("--uri URI and --out DIR are needed (or --export FILE)")
        found = _record(options, uri, options.out, blocks, mocap, seconds, stamps)
    close(options, f"recorded: {found.csv}", "is it a good recording", "nanobench", "audit", found.csv)
    return options.finish("record", found)


@dataclass(frozen=True, repr=False)
class RecordBody(Result):
    """record.json: the recording, the folder of its raw tables, packets by stream, and how its clock was found."""

    csv: Path
    parquet: Path
    packets: Mapping[str, int]
    clock: Mapping[str, float]
    notes: Sequence[str]


def _record(options: Options, uri: str, out: Path, blocks: Path | None, mocap: str | None, seconds: float | None,
            stamps: str) -> RecordBody:
    from ..radio.blocks import default_blocks, read_blocks
    from ..radio.host_clock import HostClock
    from ..radio.mocap.mocap_sources import pose_source
    from ..radio.recorder import Recorder, check_folder, recording_name
    from ..radio.vehicle_link import open_link

    wanted = read_blocks(blocks) if blocks else default_blocks()
    source = pose_source(mocap, uri) if mocap else None
    check_folder(out)
    clock = HostClock()
    with ExitStack() as stack:
        link = stack.enter_context(open_link(uri, clock, toc_cache()))
        running = link.start_blocks(wanted)
        synthetic = uri.startswith("udp://") or (source is not None and source.synthetic)
        sheet = {"crazyflie_id": uri, "trajectory_type": "unknown", "synthetic": synthetic}
        recorder = Recorder(out, recording_name(["recording"], clock.now()), link, running, sheet, clock)
        stack.callback(recorder.close)
        if source is not None:
            stack.callback(source.close)
            source.start(recorder.pose)
        recorder.start()
        options.say(f"recording {len(running)} blocks of {uri} to {recorder.path}"
                    + ("" if seconds else "; Ctrl-C ends it"))
        _wait(options, seconds, link, recorder)
    return _export(options, recorder.path, stamps)


def _repair(options: Options, damaged: Path) -> Path:
    from ..radio.packets import repair

    whole = damaged.with_name(f"{damaged.stem}.repaired{damaged.suffix}")
    found = repair(damaged, whole)
    options.say(f"{whole}: {len(found.records)} records; {found.cut or 'there was no damage'}")
    return whole


def _wait(options: Options, seconds: float | None, link: Any, recorder: Recorder) -> None:
    """Until the time is over, the link is lost or Ctrl-C, all of which end a recording well."""
    until = time.monotonic() + (seconds or float("inf"))
    try:
        while time.monotonic() < until:
            if link.lost:
                options.say(f"the link is lost: {link.lost}; what came until then is kept")
                return
            link.request_echo()
            begun = time.monotonic()
            time.sleep(EVERY_S)
            recorder.loop(time.monotonic() - begun - EVERY_S)
    except KeyboardInterrupt:
        options.say("ended by Ctrl-C")


def _export(options: Options, raw: Path, stamps: str) -> RecordBody:
    from ..radio.record_export import export

    return say_export(options, export(raw, options.out, stamps))


def say_export(options: Options, found: Exported) -> RecordBody:
    """Reports what was written."""
    for note in found.notes:
        options.say(note)
    clock = found.alignment
    options.say(f"{found.csv}: " + ", ".join(f"{name} {n}" for name, n in found.counts.items()) + " packets")
    options.say(f"clock offset: ± {1e3 * clock.ci95_s:.2f} ms (95 %) if both directions of the link are equally fast, "
                f"± {1e3 * clock.bound_s:.1f} ms for any link. Drift {1e6 * (clock.rate - 1.0):+.1f} ppm, "
                f"fastest packet {1e3 * clock.down_s:.1f} ms")
    options.say(f"raw tables: {found.parquet}")
    return RecordBody(found.csv, found.parquet, found.counts, clock.to_json(), found.notes)


def toc_cache() -> Path | None:
    """Where cflib keeps tables of contents, so that connecting again is quick; None where nothing can be written."""
    from ..results.cache_folder import cache_folder

    folder = cache_folder() / "radio"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder

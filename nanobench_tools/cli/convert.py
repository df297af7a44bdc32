"""``nanobench convert``: recordings into another format, a simulator.toml into other simulators."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import UsageError
from ..steps.options import Options, one_line
from ..tables.result_table import Table
from .closing import close
from .shared_options import shared_options

if TYPE_CHECKING:
    from ..flight import Flight
    from ..physics import Model
    from ..physics.export import Assumed, Exported
    from ..physics.hover import Hover

FORMATS = ("nanobench", "parquet", "tum", "euroc", "kitti", "rpg", "rrd")
SIMULATORS = ("rotorpy", "crazyflow", "urdf", "c", "casadi")
FIRMWARE_APP, FIRMWARE_FILTER = "firmware-app", "firmware-filter"
"""A controller and an estimator for the vehicle itself."""
ONE_TIME = ("nanobench",)
"""Formats in which all streams share one column of time."""
ALL = "all-simulators"


@click.command()
@shared_options("seed", "clock")
@click.option("--to", type=click.Choice([*FORMATS, *SIMULATORS, ALL, FIRMWARE_APP, FIRMWARE_FILTER]),
              default="nanobench", show_default=True, metavar="FORMAT",
              help="Recordings: nanobench (CSV with its sheet), parquet (a file per stream, SI units), or rrd (for the "
                   "Rerun viewer). Their mocap trajectory: tum, euroc or kitti (all for evo), or rpg. SIMULATOR.toml: "
                   "rotorpy, "
                   f"crazyflow (also drone-models), urdf (gym-pybullet-drones), c, casadi, or {ALL}. "
                   f"{FIRMWARE_APP}: a predictive controller for this vehicle, as C for the Crazyflie firmware. "
                   f"{FIRMWARE_FILTER}, without a PATH: the filter drag_matrix_ekf, likewise.")
@click.option("--mocap", type=click.Path(path_type=Path), metavar="FILE",
              help="Motion capture of the same flight, recorded on a separate clock (TUM, or any known format). Its "
                   "time offset is found from the turning rates.")
@click.option("--battery", "battery_V", type=float, metavar="V",
              help="SIMULATOR.toml: battery voltage at which the greatest thrust is taken. [default: 3.7]")
@click.option("--k-f", "k_f", type=float, metavar="N_s2/rad2",
              help="SIMULATOR.toml without thrust_rpm: thrust over rotor speed squared. [default: 2.3e-8]")
def convert(options: Options, to: str, mocap: Path | None, battery_V: float | None, k_f: float | None) -> int:
    """Write recordings of any known source in another format, one per recording into --out DIR. Or write a
    simulator.toml as parameters of other simulators, with a list of what each of them cannot express.

    \b
    nanobench convert log.bin --out csv            an onboard log as CSV with its sheet
    nanobench convert log.bin --mocap traj.tum --out csv    the same, with its motion capture
    nanobench convert flight.csv --to rrd --out DIR        to look at in Rerun: path, attitude, signals, faults
    nanobench convert simulator.toml --to rotorpy --out DIR        a fitted vehicle for RotorPy
    nanobench convert simulator.toml --to firmware-app --out DIR   a controller to build with the firmware
    nanobench convert --to firmware-filter --out DIR               an estimator to build with the firmware
    """
    if options.out is None:
        raise UsageError("nanobench convert: --out DIR is needed")
    if to == FIRMWARE_FILTER:
        if options.data or mocap is not None or battery_V is not None or k_f is not None:
            raise UsageError(f"nanobench convert: --to {FIRMWARE_FILTER} takes --out alone")
        return _convert_filter(options)
    models = [path for path in options.data if to not in FORMATS or path.suffix.lower() == ".toml"]
    if models or to not in FORMATS:
        simulator = models[0] if models else None
        options.data = tuple(path for path in options.data if path != simulator)
        return _convert_simulator(options, simulator, to, mocap, {"battery_V": battery_V, "k_f": k_f})
    if battery_V is not None or k_f is not None:
        raise UsageError("nanobench convert: --battery and --k-f belong to a SIMULATOR.toml")
    return _convert_recordings(options, to, mocap)


def _convert_recordings(options: Options, to: str, mocap: Path | None) -> int:
    from ..harness import make_item, run_items
    from ..sources import load_recordings

    if to == "rrd":
        from ..steps.rerun_recording import rerun

        rerun()  # said once, before anything is read
    flights = options.load()
    if mocap is not None:
        from ..time_offsets.moving.pairing import with_mocap

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
    omitted = _omitted(options, flights, to)
    count = len(result.values)
    text = f"{count} recording{'s' * (count != 1)} written to {options.out}"
    if to == "parquet":  # a file per stream, for other programs
        tables = sorted(path for value in result.values.values() for path in Path(value["file"]).glob("*.parquet"))
        look = [f"import pandas; print(pandas.read_parquet({str(table)!r}))" for table in tables[:1]]
        close(options, text, "look at one", *(("python", "-c", *look) if look else ()))
    elif to == "rrd":
        close(options, text, "look at it", "rerun", *[value["file"] for value in result.values.values()][:1])
    else:
        close(options, text, "what is in them", "nanobench", "audit", options.out)
    return options.finish("convert", {"to": to, "files": [value["file"] for value in result.values.values()],
                                      "omitted": omitted})


def _omitted(options: Options, flights: Sequence[Flight], to: str) -> list[dict[str, str]]:
    """Streams that a format with one time for all leaves empty, each said: [{flight, stream, reason}]."""
    from ..signals.common_time import apart, told

    found = [{"flight": flight.name, "stream": a.stream, "reason": told(a, flight.epoch_s)}
             for flight in flights for a in apart(flight)] if to in ONE_TIME else []
    for lack in found:
        options.show(f"WARNING: {one_line(lack['flight'])}: {lack['stream']} is omitted, {one_line(lack['reason'])}")
    return found


def convert_item(flight: Flight, out_dir: Path, to: str) -> dict[str, Any]:
    """Writes one recording."""
    from ..steps.export import export

    return {"file": str(export(flight, out_dir, to))}


def _convert_simulator(options: Options, path: Path | None, to: str, mocap: Path | None,
                       assumed: dict[str, float | None]) -> int:
    from ..physics.export import Assumed
    from ..physics.simulator import read_simulator

    if path is None:
        raise UsageError(f"nanobench convert: --to {to} needs a SIMULATOR.toml")
    if to in FORMATS:
        raise UsageError(f"nanobench convert: --to {to} is for recordings; give one of {', '.join(SIMULATORS)}, {ALL}")
    if mocap is not None or options.data:
        raise UsageError("nanobench convert: other paths and --mocap do not go with a SIMULATOR.toml")
    given = replace(Assumed(), **{name: value for name, value in assumed.items() if value is not None})
    model = read_simulator(path)
    if to == FIRMWARE_APP:
        return _convert_to_app(options, path, model, assumed)
    found = export_simulators(model, options.out, SIMULATORS if to == ALL else (to,), given)
    at_hover, said = _hover(model, given.battery_V)
    close(options, f"{path} written for {', '.join(found)} to {options.out}", "fly this vehicle, simulated",
          "nanobench", "simulate", "--serve", "udp://127.0.0.1:19850", "--simulator", path,
          screen=[_accounts(found), *said], detail=[*_accounts_in_full(found), *said])
    return options.finish("convert", {"to": to, "simulator": str(path), "hover": at_hover,
                                      **exported_body(found)})


def _convert_to_app(options: Options, path: Path, model: Model, assumed: dict[str, float | None]) -> int:
    from controllers.mpc.hover_app import costs, write_app

    if any(value is not None for value in assumed.values()):
        raise UsageError(f"nanobench convert: --battery and --k-f do not go with --to {FIRMWARE_APP}")
    found = {FIRMWARE_APP: write_app(model, options.out or Path())}
    least, *_, most = costs().values()
    said = (f"ESTIMATE of a command on the vehicle: {least.milliseconds:.2f} ms, and {most.milliseconds:.2f} ms where "
            "many motors meet bounds. Never compiled against the firmware itself: test it on a tether")
    close(options, f"{path} written as a controller of the Crazyflie firmware to {options.out}", "build it",
          "make", "-C", options.out, "CRAZYFLIE_BASE=/path/to/crazyflie-firmware",
          screen=[_accounts(found), said], detail=[*_accounts_in_full(found), said])
    return options.finish("convert", {"to": FIRMWARE_APP, "simulator": str(path), **exported_body(found)})


def _convert_filter(options: Options) -> int:
    from estimators.filter_app import costs, write_filter

    files = write_filter(options.out or Path())
    row, pose = costs().values()
    close(options, f"drag_matrix_ekf written as an estimator of the Crazyflie firmware to {options.out}", "build it",
          "make", "-C", options.out, "CRAZYFLIE_BASE=/path/to/crazyflie-firmware",
          screen=[f"ESTIMATE on the vehicle: {row.milliseconds:.2f} ms a row of the IMU, {pose.milliseconds:.2f} ms a "
                  "pose. Never compiled against the firmware itself: carry it by hand first"])
    return options.finish("convert", {"to": FIRMWARE_FILTER, "files": [str(file) for file in files]})


def _accounts(found: Mapping[str, Exported]) -> Table:
    """One row per simulator: the terms that it approximates or omits, and the numbers that were assumed."""
    rows = [(name, *(", ".join(map(one_line, part)) or "-" for part in (
        exported.account.approximated, exported.account.left_out, exported.account.assumed)))
        for name, exported in found.items()]
    return Table.plain("", ("simulator", "approximated", "LEFT OUT", "assumed"), rows)


def _accounts_in_full(found: Mapping[str, Exported]) -> list[Table | str]:
    """The files of each simulator, and a line for everything that is not the same in it."""
    lines: list[Table | str] = []
    for name, exported in found.items():
        lines.append(f"{name}: {', '.join(one_line(str(file)) for file in exported.files)}")
        lines += [f"  {one_line(line)}" for line in exported.account.lines()]
    return lines


def _hover(model: Model, battery_V: float) -> tuple[Hover | None, list[str]]:
    """How the exported vehicle hovers and turns, and this in words; None where it cannot hover."""
    from ..physics.hover import doubts, hover

    try:
        found = hover(model, battery_V)
    except UsageError as error:
        return None, [f"WARNING: {error}"]
    return found, [found.sentence, *(f"WARNING: {line}" for line in doubts(model))]


def export_simulators(model: Model, folder: Path | None, targets: Sequence[str] = SIMULATORS,
                      assumed: Assumed | None = None) -> dict[str, Exported]:
    """Writes {target: files} into ``folder``."""
    from ..physics.export import export_model

    return {to: export_model(model, to, folder or Path(), assumed) for to in targets}


def exported_body(found: dict[str, Exported]) -> dict[str, Any]:
    """The keys of the result file: ``files``, and what each simulator makes of the model."""
    from dataclasses import asdict

    return {"files": [str(file) for exported in found.values() for file in exported.files],
            "simulators": {name: {"files": [str(file) for file in exported.files], **asdict(exported.account)}
                           for name, exported in found.items()}}

"""``nanobench thrust``: maps from PWM and battery voltage to thrust, from stand series and from flights."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import UsageError
from ..flight import Flight
from ..protocols.sessions import short_note
from ..results.result import to_json
from ..steps.options import Options
from ..steps.sentences import interval
from ..steps.show import data_word
from ..steps.thrusting import UNITS, thrust_maps, thrust_sentence
from ..tables.result_table import Table
from .closing import again, close, shown_page
from .shared_options import PATH, no_paths_beside, shared_options

if TYPE_CHECKING:
    from identification.thrust.error_rows import ErrorRow
    from identification.thrust.thrust_result import FlightResult, Part, StandResult, ThrustResult




@click.command()
@shared_options()
@click.option("--train", multiple=True, type=PATH, metavar="PATH", help="Fit to these recordings (with --test).")
@click.option("--test", multiple=True, type=PATH, metavar="PATH", help="Score on these recordings (with --train).")
@click.option("--mass", type=float, metavar="KG",
              help="Mass of the vehicle that flew; free flight shows thrust over mass only. Default: 0.04085 kg.")
def thrust(options: Options, train: tuple[Path, ...], test: tuple[Path, ...], mass: float | None) -> int:
    """Thrust from PWM and battery voltage: which map holds for recordings it was not fitted to?

    Fits polynomials, motor models and the firmware's curves, and chooses by training files held out in turn. The data
    are thrust-stand tables (thrust per motor) and flights (body-z specific force of the accelerometer, 3 Hz low-pass).
    Without --train and --test each stand series is predicted from the others of its propeller. Flights are split as in
    Task 1. --out gets thrust.json, thrust.html, terms.toml (for a simulator) and thrust_firmware.h."""
    from identification.thrust.flight_fit import models

    from ..physics.vehicle import Vehicle

    if bool(train) != bool(test):
        raise UsageError("--train and --test go together; recordings given as PATH are divided")
    if train:
        no_paths_beside(options, "--train")
    mass_kg = Vehicle().mass_kg if mass is None else mass
    models(mass_kg)  # report an invalid mass before anything is read
    flights = options.load([*train, *test] if train else None)
    parts = None
    if train:
        inside = [any(Path(f.provenance.path).is_relative_to(place) for place in train) for f in flights]
        parts = ([f for f, known in zip(flights, inside, strict=True) if known],
                 [f for f, known in zip(flights, inside, strict=True) if not known])
    found, kinds = thrust_maps(options, flights, parts, mass_kg)
    assumed = "--mass" if mass is None else ""
    if options.out is not None:
        _write(options, options.out, found, flights, assumed)
    why, command = ("see it", shown_page(options.out / "thrust.html")) if options.out is not None else (
        "as files", tuple(again("--out", "thrust")))
    close(options, thrust_sentence(found), why, *command,
          screen=[p for part in kinds for p in maps_screen(options, part, assumed)],
          detail=[p for part in kinds for p in maps_detail(options, part, assumed)])
    return options.finish("thrust", to_json(found))


def _write(options: Options, out: Path, found: ThrustResult, flights: Sequence[Flight], assumed: str) -> None:
    from identification.thrust.thrust_page import thrust_page

    from ..pages.report_page import recordings_of
    from ..results.result_files import write_bytes

    out.mkdir(parents=True, exist_ok=True)
    first = found.flight or found.stand
    if first is not None and first.chosen is not None:
        write_bytes(out / "terms.toml", first.chosen.toml.encode())
        if first.chosen.firmware:
            write_bytes(out / "thrust_firmware.h", first.chosen.firmware.encode())
    data = recordings_of([f.name for f in flights], [f.provenance.path for f in flights])
    made = datetime.fromtimestamp(options.started, UTC).date().isoformat()
    page = thrust_page(found, f"{data}, {made}", options.synthetic, assumed)
    write_bytes(out / "thrust.html", page.encode(errors="replace"))
    options.say(f"{out / 'thrust.html'} ({len(page) / 1e6:.1f} MB)")


def _given(part: Part) -> dict[str, str]:
    """What predictions are made from -> the models that have it."""
    from identification.thrust.map_words import in_words

    found: dict[str, dict[str, None]] = {}
    for row in part.rows:
        if row.given:
            found.setdefault(row.given, {})[in_words(row.model)] = None
    return {given: "; ".join(names) for given, names in found.items()}


def maps_screen(options: Options, part: Part, assumed: str = "") -> list[Table | str]:
    """The formula of the chosen map, what it gives, then every map on rows held out. assumed: see ``formula``."""
    unit = UNITS[part.kind][0]
    rows = sorted([row for row in part.rows if row.split == "test"] or part.rows,
                  key=lambda row: row.model != part.result.best)
    heads = ("map", f"RMS {unit}", "95 %", "files", "inside 95 %", "status")
    kept = [i for i in range(len(heads)) if any(_cells(row, part)[i] != "-" for row in rows)]
    note = short_note(rows) if part.found.flown else short_note(rows).replace("one flight", "one file")
    source = ("files that were" if max(row.files for row in rows) > 1 else "a file that was"
              if part.result.split.endswith("as given") else "pieces of the file that were")
    table = Table.plain(
        f"Thrust from {part.kind}s, {data_word(options)} data, rows of {source} "
        + ("held out" if rows[0].split == "test" else "fitted to"), [heads[i] for i in kept],
        [[_cells(row, part)[i] for i in kept] for row in rows], note)
    return [*formula(part, assumed), table]


def _cells(row: ErrorRow, part: Part) -> tuple[str, ...]:
    from identification.thrust.map_words import in_words

    _, factor, digits = UNITS[part.kind]
    return (in_words(row.model) + ("*" if row.model == part.result.best else ""), f"{factor * row.rms:.{digits}f}",
            "-" if row.ci95 is None else " .. ".join(f"{factor * x:.{digits}f}" for x in row.ci95), str(row.files),
            "-" if row.coverage95 is None else f"{100 * row.coverage95:.0f} %", row.status)


def formula(part: Part, assumed: str = "") -> list[str]:
    """The chosen map with its numbers and units, and its thrust at hover and at full command.

    assumed: option of the mass, where it was not given."""
    from identification.thrust.map_words import in_words
    from identification.thrust.thrust_formula import MEANING

    result = part.result
    if result.best is None:
        return ["No map is a result: none predicts held-out rows better than a constant" + "".join(
            f"; {in_words(name)}: {why}" for name, why in result.no_result.items())]
    if result.chosen is None:
        return [in_words(result.best)]
    found = result.chosen.formula
    return [f"Chosen map: {found.text}", MEANING, *found.lines(assumed)]


def coefficients(part: Part) -> list[str]:
    """Parameters of the chosen map with their intervals."""
    return [f"{name} = {p.value:.5g} {p.unit}{interval(p.ci95)}"
            for name, p in part.result.parameters.get(part.result.best or "", {}).items()]


def maps_detail(options: Options, part: Part, assumed: str = "") -> list[Table | str]:
    """Every map on training and held-out rows, of flights as recorded, too; the chosen map, and the firmware's for
    comparison."""
    from identification.thrust.thrust_result import FlightResult

    from ..protocols.sessions import interval_note

    flown = part.result if isinstance(part.result, FlightResult) else None
    as_recorded = flown.as_recorded.rows if flown is not None and flown.as_recorded is not None else ()
    unit = UNITS[part.kind][0]
    what = "thrust per motor on rows that spin" if flown is None else "body-z specific force, 3 Hz low-pass"
    heads = ("map", "clock", "split", f"RMS {unit}", "95 %", "n", "files", "in 95 % interval", "status")
    rows = []
    for row in [*as_recorded, *part.rows]:
        name, *numbers, files, inside, status = _cells(row, part)
        rows.append((name, row.clock, row.split, *numbers, str(row.n), files, inside, status))
    table = Table.plain(f"Thrust from {part.kind}s: {data_word(options)} data, RMS error of {what}, "
                        f"{part.result.split}", heads, rows, interval_note(part.rows))
    return [table, *formula(part, assumed), *coefficients(part), *_of_chosen(part), *_against_firmware(part.result)]


def _of_chosen(part: Part) -> list[str]:
    """How the map was chosen, what it was given, how its intervals were drawn."""
    from identification.thrust.map_words import in_words
    from identification.thrust.thrust_result import FlightResult

    result = part.result
    if result.best is None or result.chosen is None:
        return []
    unit, factor, digits = UNITS[part.kind]
    held = result.held_out_coverage95.get(result.best) if isinstance(result, FlightResult) else None
    files, why = len(part.found.train), part.found.why
    kind = "training flights in sessions" if part.found.flown else "stand series"
    drawn = f"95 % intervals of {files} {kind} drawn" + (f"; {why}" if why else "")
    return [f"{in_words(result.best)} was chosen by training files held out in turn "
            f"({factor * result.held_out_rms[result.best]:.{digits}f} {unit}); "
            f"95 % of a row of a new file within ± {factor * result.chosen.interval_half_width:.{digits}f} {unit}"
            + ("." if held is None else f" (contains {100 * held:.0f} % of training rows held out in turn)."),
            *(f"given {given}: {names}" for given, names in _given(part).items()),
            drawn if any(p.ci95 for p in result.parameters[result.best].values())
            else f"no intervals: {why or 'refits to drawn files fail'}"]


def _against_firmware(result: StandResult | FlightResult) -> list[str]:
    """Compares the chosen map with the firmware's on held-out files; lists the series from which each stand series was
    predicted."""
    from identification.thrust.map_words import in_words
    from identification.thrust.thrust_result import StandResult

    pairs = result.against_firmware
    if not pairs or result.best is None:
        return []
    scaled = [p.scaled_beaten for p in pairs if p.scaled_beaten is not None]
    lines = [f"On {sum(p.beaten for p in pairs)} of {len(pairs)} held-out files the error is smaller than that of the "
             f"firmware's better curve. With it scaled to the training files: on {sum(scaled)} of {len(scaled)}."]
    if not isinstance(result, StandResult):
        return lines
    unit, factor, digits = UNITS["stand"]
    for p in pairs:
        how = (result.held_out or {}).get(p.file)
        to = ", ".join(how.fitted_to) if how and how.fitted_to else "its own other PWM bands"
        if how and how.same_propeller and len(how.fitted_to) == 1:
            to += ", the only other one of its propeller"
        basis = "" if how is None else f" ({in_words(str(how.best))} fitted to {to}" + (
            "" if how.same_propeller is not False else ": none of the same propeller") + ")"
        lines.append(f"{p.file}: {factor * p.rms:.{digits}f} against {factor * p.firmware:.{digits}f} {unit}{basis}")
        own = how.own_bands if how and how.fitted_to else None
        if own and own.rms_N and own.firmware_N:
            lines.append(f"  from its own other PWM bands: {factor * own.rms_N:.{digits}f} against "
                         f"{factor * own.firmware_N:.{digits}f} {unit} ({in_words(str(own.best))})")
    return lines

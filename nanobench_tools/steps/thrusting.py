"""Thrust maps of recordings, for ``nanobench thrust`` and ``nb.thrust``: what trains, what is held out, the maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..flight import Flight
from .options import Options
from .show import say_reasons

if TYPE_CHECKING:
    from identification.thrust.thrust_result import Part, ThrustResult

    from ..auditing.recording_audit import Audit


UNITS = {"stand": ("mN per motor", 1e3, 2), "flight": ("m/s²", 1.0, 4)}
"""Of errors as shown, times what is stored, digits."""


def thrust_sentence(found: ThrustResult) -> str:
    """The chosen map, and how far off it is on files it was not fitted to."""
    from identification.thrust.map_words import in_words

    part, kind = (found.flight, "flight") if found.flight is not None else (found.stand, "stand")
    if found.best is None or part is None:
        return "no map is a result"
    unit, factor, digits = UNITS[kind]
    files = {error.file for error in part.per_file}
    off = factor * part.held_out_rms[found.best]
    return (f"best map: {in_words(found.best)}, off by {off:.{digits}f} {unit} (RMS) on "
            + ("training files" if len(files) > 1 else "pieces of the only file") + " held out in turn")


def thrust_maps(options: Options, flights: Sequence[Flight],
                  given: tuple[Sequence[Flight], Sequence[Flight]] | None = None,
                  mass_kg: float = 0.04085) -> tuple[ThrustResult, list[Part]]:
    """The result, and its parts with the fits; ``given`` (train, test) replaces the splits. InputError when nothing
    can be fitted."""
    from identification.thrust.thrust_result import whole
    from identification.thrust.thrust_rows import sort_out

    left: dict[str, str] = {}
    stands, flown = sort_out(flights)
    names = None if given is None else ({f.name for f in given[0]}, {f.name for f in given[1]})
    found = [part for part in (_stands(options, stands, names, mass_kg, left),
                               _flights(options, flown, names, mass_kg, left)) if part is not None]
    say_reasons(options, left.items())
    if not found:
        place = flights[0].provenance.path
        reason = next(iter(left.values()), "no stand series and no flight with motors, battery and accelerometer")
        more = f" (and {len(left) - 1} more recordings left out)" if len(left) > 1 else ""
        remedy = ("" if "; " in reason else  # of a fault: its own
                  "a map takes motor commands, battery voltage and the accelerometer (m1 .. m4, vbat, acc_z), or a "
                  "thrust-stand table")
        raise InputError(place, f"nothing to fit: {reason}{more}", remedy)
    return whole(found, left), found


def _stands(options: Options, stands: Sequence[Flight], names: tuple[set[str], set[str]] | None, mass_kg: float,
            left: dict[str, str]) -> Part | None:
    from identification.thrust.thrust_result import stand_part
    from identification.thrust.thrust_rows import stand_rows

    rows = stand_rows(stands)
    left |= rows.reasons
    if not rows.files:
        return None
    if names is None:
        return stand_part(rows.files, None, mass_kg, options.seed)
    train = [f for f in rows.files if f.name in names[0]]
    test = [f for f in rows.files if f.name in names[1]]
    if not train or not test:
        for f in (*train, *test):
            left[f.name] = f"a stand series, but none of --{'test' if train else 'train'} can be used with it"
        return None
    return stand_part(train, test, mass_kg, options.seed)


def _flights(options: Options, flights: Sequence[Flight], names: tuple[set[str], set[str]] | None, mass_kg: float,
             left: dict[str, str]) -> Part | None:
    from identification.thrust.thrust_result import AsRecorded, flight_part
    from identification.thrust.thrust_rows import flown_rows

    if not flights:
        return None
    audits, _ = options.audit(flights)
    found: Part | None = None
    before: AsRecorded | None = None
    for clock in dict.fromkeys(("as-recorded", options.clock)):
        on_clock, verdicts = (flights, audits) if clock == "as-recorded" else options.on_clock(flights, audits)
        train, test, note, reasons = _split(on_clock, verdicts, names)
        part = flight_part(train, test, mass_kg, options.seed, clock, note, before)
        if clock == options.clock:
            left |= reasons | (part.reasons if part else flown_rows(train, 0.0).reasons)
        if part is not None:
            found, before = part, AsRecorded(part.rows, part.result.best)
    return found


def _split(flights: Sequence[Flight], audits: Mapping[str, Audit],
           names: tuple[set[str], set[str]] | None) -> tuple[list[Any], list[Any], str, dict[str, str]]:
    """(training cases, test cases, how they were chosen, reasons of the recordings in neither)."""
    from identification.thrust.thrust_rows import cases_of

    from ..auditing.selection import apart, distinct
    from ..protocols import task1

    cases, reasons = cases_of(flights, audits)
    by_name = {flight.name: (flight, spans) for flight, spans in cases}
    usable = [_comparable(flight) for flight, _ in cases]
    if names is None:
        kept = distinct(usable)[0]
        try:
            chosen = {case.flight.name for case in task1.split(flights, audits).train}
            note = "train: earliest recording of each trajectory of five families; test: the others"
        except InputError as error:
            chosen, note = {f.name for f in kept}, f"all flights train, none is held out ({error.found})"
        train = [f for f in kept if f.name in chosen]
        test = [f for f in kept if f.name not in chosen]
        if not train:
            train, test, note = test, [], "all flights train: none is of the families that train in Task 1"
    else:
        train = distinct([f for f in usable if f.name in names[0]])[0]
        test = [f for f in usable if f.name in names[1]]
        note = "train and test as given"
    others, shared = apart(train, test)
    test = distinct(others)[0]
    used = {f.name for f in (*train, *test)}
    reasons |= {f.name: shared.get(f.name, "copy or slice of another recording") for f in usable if f.name not in used}
    return [by_name[f.name] for f in train], [by_name[f.name] for f in test], note, reasons


def _comparable(flight: Flight) -> Flight:
    """The flight, without a motion capture that holds no positions: copies are found by these."""
    whole = "mocap" not in flight or all(q in flight["mocap"] for q in ("px", "py", "pz"))
    return flight if whole else flight.without_streams("mocap")

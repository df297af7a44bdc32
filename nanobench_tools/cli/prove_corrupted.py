"""``nanobench prove --corrupted``: real flights, diagnosed against simulators with a wrong belief."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError, UsageError
from ..steps.options import Options, one_line
from ..tables.result_table import Table as Grid
from .closing import again, close

if TYPE_CHECKING:
    from identification.prove.corrupted.corrupted_rates import CorruptedProof
    from identification.prove.corrupted.groups import Group

DEFAULT_PLACES = "the default places"
MOST_GROUPS = 2
"""Groups of flights of a vehicle, unless asked otherwise."""


def corrupted(options: Options, place: str, n: int | None, engine: str, vehicles: Sequence[str],
              left_out: Sequence[str], groups: int | None) -> CorruptedProof:
    """The cases of the vehicles whose recordings are below ``place``, ``n`` of each, diagnosed by an engine and scored.
    InputError without recordings."""
    from identification.prove.corrupted import VEHICLES, cases_of, groups_of
    from identification.prove.corrupted.case_score import score_all
    from identification.prove.corrupted.corrupted_rates import CorruptedProof
    from identification.prove.corrupted.engines import engine_of
    from identification.prove.corrupted.judge import Judge, drawn, run
    from identification.prove.corrupted.vehicles import named, paths_of

    chosen = engine_of(engine)
    asked = [v for v in (named(vehicles) if vehicles else VEHICLES) if v not in named(left_out)]
    roots = recording_roots(place, "--corrupted")
    seen = {v.name: root for v in asked for root in reversed(roots) if paths_of(v, root)}
    absent = [v.name for v in asked if v.name not in seen]
    if absent:
        options.say(f"no recordings of {', '.join(absent)} below {', '.join(map(str, roots))}")
    of: dict[str, list[Group]] = {}
    why = ""
    for vehicle in (v for v in asked if v.name in seen):
        try:
            of[vehicle.name] = groups_of(vehicle, seen[vehicle.name], groups or MOST_GROUPS, options.say)
        except InputError as error:  # too little clean flight for a nominal simulator: the others go on
            why = f"{vehicle.name} is left out: {one_line(str(error))}"
            options.say(why)
    found = [g for mine in of.values() for g in mine]
    if not found and why:
        raise InputError(f"--corrupted {place}", f"has no vehicle with enough clean flight; {why}",
                         "give the folder of more flights")
    if not found:
        folders = ", ".join(v.folder for v in asked)
        raise InputError(f"--corrupted {place}", "has no recordings of a known vehicle",
                         f"give the folder that has {folders}")
    cases = [c for mine in of.values()
             for c in drawn([c for g in mine for c in cases_of(g, options.seed, options.say)], n, options.seed)]
    options.say(f"{len(cases)} cases on {len(found)} groups of real flights, engine {chosen.name}")
    verdicts = run(Judge(chosen, found, options.seed), cases, options.run)
    proof = CorruptedProof.of(chosen.name, options.seed, score_all(cases, verdicts))
    show(options, proof)
    return proof


def recording_roots(place: str, option: str) -> list[Path]:
    """Folders that may have the recordings of the vehicles; ``option``: named in errors."""
    if place != DEFAULT_PLACES:
        if not Path(place).is_dir():
            raise InputError(f"{option} {place}", "is no folder", "give the folder of the recordings")
        return [Path(place)]
    given = [Path(p) for p in os.environ.get("NANOBENCH_DATA", "").split(os.pathsep) if p]
    places = [*given, *(p.parent for p in given), Path("data"), Path("..") / "shared" / "data"]
    found = [p for p in places if p.is_dir()]
    if not found:
        raise UsageError(f"no recordings in $NANOBENCH_DATA, ./data or ../shared/data; give {option} DIR")
    return found


def show(options: Options, proof: CorruptedProof) -> None:
    """By vehicle and size on one screen; by belief and kind with ``--verbose``."""
    from identification.prove.corrupted.corrupted_rates import HEADS, rows

    def grid(title: str, first: str, named: object) -> Grid:
        assert isinstance(named, dict)
        return Grid.plain(title, (first, *HEADS[1:]), rows(named))

    title = f"Wrong simulators on real flights, engine {proof.engine} [exact 95 %]"
    by_vehicle = grid(title, "vehicle", {**proof.by_vehicle, "all": proof.all})
    by_size = grid("Single beliefs, size over the smallest that predictions show", "size", dict(proof.by_size))
    by_belief = grid("By wrong belief", "belief", dict(proof.by_belief))
    by_kind = grid("By kind", "kind", dict(proof.by_kind))
    controls = [f"Identified with the nominal simulator, {group}: {', '.join(names)}"
                for group, names in proof.controls.items()]
    stated = [f"Stated {c:.0%}: {right:.0%} right of {n}" for c, right, n in proof.calibration]
    every = proof.all
    lost = [s for s in proof.cases if s.error]
    if lost:
        options.say(f"no verdict in {len(lost)} cases, the first {lost[0].case}: {one_line(lost[0].error)}")
    result = (f"{every.identified.right} of {every.identified.n} visible effects identified, false effects in "
              f"{every.false.right} of {every.false.n} cases")
    close(options, result, "the cases by term", *again("--verbose"), screen=[by_vehicle, by_size],
          detail=[by_vehicle, by_size, by_kind, by_belief, *controls, *stated])

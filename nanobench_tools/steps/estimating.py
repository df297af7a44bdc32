"""Scores of state estimators (Task 3): what ``nanobench estimate`` and ``nb.estimate`` are made of."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..auditing import verb_needs
from ..errors import InputError
from ..time_offsets.moving.votes import AS_RECORDED, voters, votes
from .estimate_pictures import aided_bands, blackout_bands
from .named_methods import load_methods
from .options import Options
from .result_bodies import EstimateBody, TakenOut
from .show import ALL_FAILED, show_left_out

if TYPE_CHECKING:
    from ..auditing.recording_audit import Audit
    from ..auditing.usable import Needed
    from ..flight import Flight
    from ..harness.clocks import OnClock
    from ..protocols.aided import Aiding
    from ..protocols.compare import ClockRanking
    from ..protocols.dead_logs import DeadLog
    from ..protocols.result_rows import EstimateRow, FlightScore, Metrics, Scored, WindowScore
    from ..protocols.task3 import Case
    from .estimate_pictures import DrawnBand

LOGGED = ("onboard_ekf",)
FLOORS = ("hold_position", "constant_velocity")
RECKONING = ("strapdown", "error_state_ekf", "drag_ekf", "drag_matrix_ekf", "invariant_ekf")
DEFAULT_METHODS = {"as-published": LOGGED, "as-published-corrected": LOGGED, "clean": LOGGED + FLOORS,
                   "aided": (*LOGGED, *RECKONING, "delayed_pose_ekf", *FLOORS), "blackout": RECKONING + FLOORS,
                   "whole-flight": RECKONING + FLOORS}
"""Scored when no other is requested."""

JUDGED = ("position", "velocity")
"""Streams of the logged estimate that every metric other than those of attitude judges."""
LOGGED_STREAMS = ("estimator", "estimator_acc", "attitude", "attitude_qw")
"""Hidden from every method on a clock that the logged position helped to set."""

NEEDS = {**dict.fromkeys(LOGGED, verb_needs.LOGGED),
         **dict.fromkeys((*RECKONING, "delayed_pose_ekf"), verb_needs.INERTIAL),
         **dict.fromkeys(FLOORS, verb_needs.STAMPED)}
"""What default methods need of a flight; methods of one's own say so themselves."""

SHOWN_FIRST = ("ate_rmse_m", "end_error_5s_m", "drift_percent")
"""The metric that stands for a row in one line: the first that it has."""

def trajectory_files(folders: Sequence[Path]) -> dict[str, dict[str, Path]]:
    """{method: {name of the flight: file}}; InputError for a folder without .tum files."""
    found: dict[str, dict[str, Path]] = {}
    for folder in folders:
        files = {path.stem: path for path in sorted(folder.glob("*.tum"))} if folder.is_dir() else {}
        if not files:
            raise InputError(f"--trajectory-dir {folder}", "holds no .tum file" if folder.is_dir() else "is no folder")
        found[folder.absolute().name] = files
    return found


@dataclass(frozen=True)
class Seen:
    """The recordings on the clock of ``options``. Returns the clock that may judge positions and velocities, and the
    one for attitudes (None: the same)."""

    places: OnClock
    attitudes: OnClock | None = None


def see(options: Options, flights: Sequence[Flight], audits: Mapping[str, Audit]) -> Seen:
    """``flights`` on the clock of ``options``. In ``retimed``, the logged attitude is used to estimate the clock where
    positions are judged, but not where attitudes are. In ``joint`` all streams are used, and no logged estimate is
    judged."""
    if options.clock != "retimed":
        return Seen(options.see_on_clock(flights, audits, () if options.clock == "joint" else JUDGED))
    return Seen(options.see_on_clock(flights, audits, JUDGED),
                options.see_on_clock(flights, audits, ("attitude",)))


def estimate_body(options: Options, seen: Seen, protocols: Sequence[str] = (), methods: Sequence[Any] | None = None,
                  files: Mapping[str, Mapping[str, Path]] | None = None, trajectories: bool = True,
                  aidings: Sequence[Aiding] | None = None, further: Sequence[Any] = ()) -> EstimateBody:
    """estimate.json.

    ``protocols``: by default all that the data allow. ``methods`` replace the default ones of every protocol,
    ``further`` add to them. ``trajectories``: whether they are written to ``--out``. ``aidings``: arrival of poses in
    ``aided``, one table each; the first one's trajectories are written. Raises InputError if a requested protocol (or
    every one) has no data to score.
    """
    from ..auditing.usable import missing
    from ..auditing.verb_needs import TRUTH
    from ..protocols import aided, task3
    from ..protocols.dead_logs import dead_logs

    rows: list[EstimateRow] = []
    per_flight: list[FlightScore] = []
    windows: list[WindowScore] = []
    bands: list[DrawnBand] = []
    dead: list[DeadLog] | None = None
    written = "clean" if "clean" in (protocols or task3.PROTOCOLS) else protocols[-1]
    failed: dict[str, str] = {}
    flights, audits = seen.places.flights, seen.places.audits
    own = {method.name for method in further}

    def chosen_for(protocol: str) -> list[Any]:
        return list(methods) if methods is not None else [
            *load_methods("estimators", [m for m in DEFAULT_METHODS[protocol] if m not in own]), *further]

    def needed(method: Any) -> Needed:
        return TRUTH if method.name in own and not task3.is_logged(method) else NEEDS.get(method.name, TRUTH)

    def select(protocol: str) -> list[Case]:
        cases = task3.select(flights, audits, protocol)
        chosen = chosen_for(protocol)
        needs = [needed(method) for method in chosen if method.name not in FLOORS] or [*map(needed, chosen)]
        if files or any(missing(case.flight, each) is None for case in cases for each in needs):
            return cases
        return task3.select(flights, audits, protocol, needs[0])  # reports what is missing

    for protocol, cases in options.selected(protocols, task3.PROTOCOLS, select):
        chosen = chosen_for(protocol)
        if options.clock == "joint":
            chosen, cases = _without_logged(options, chosen, cases)
        work = [(method, case) for method in chosen for case in cases if missing(case.flight, needed(method)) is None]
        failed |= {case.flight.name: lack for case in cases for method in chosen
                   if (lack := missing(case.flight, needed(method))) is not None}
        again = {} if seen.attitudes is None or protocol == task3.BLACKOUT else {
            case.flight.name: case for case in task3.select(seen.attitudes.flights, seen.attitudes.audits, protocol)}
        if protocol == task3.PUBLISHED[0]:
            dead = dead_logs(cases, audits)
        if protocol == task3.BLACKOUT:
            scored, ends, drawn = _score_blackout(options, work, seen)
            rows += scored
            windows += ends
            bands += drawn
            continue
        work += [trajectory for name, known in (files or {}).items() for trajectory in _from_files(name, known, cases)]
        out = options.out if trajectories and protocol == written else None
        for aiding in (aidings or aided.grid()) if protocol == task3.AIDED else [None]:
            scored, single, drawn = _score(options, protocol, work, seen, out, aiding, again)
            rows += scored
            per_flight += single
            bands += drawn
            out = None
        failed |= dict.fromkeys((case.flight.name for _, case in work if case.flight.name not in failed), ALL_FAILED)
    used = {name for row in rows for name in row.flights}
    left_out = show_left_out(options, flights, used, audits, TRUTH, failed)
    taken_out = None if options.clock == AS_RECORDED else {options.clock: {
        name: TakenOut.of(offset) if offset else None for name, offset in seen.places.time_offsets.items()
        if name in used}}
    return EstimateBody(rows, per_flight, left_out, windows or None, bands or None, dead, taken_out)


def ranked_by_clock(options: Options, flights: Sequence[Flight], audits: Mapping[str, Audit], body: EstimateBody,
                    methods: Sequence[Any] | None, aidings: Sequence[Aiding] | None = None,
                    further: Sequence[Any] = ()) -> list[ClockRanking]:
    """Which method is best as recorded and re-timed, among those that were given the same. For that the flights are
    scored re-timed, too, if the audit found a time error in one of them. Empty for ``body`` on another clock, for
    trajectory files alone, and where no two methods were given the same."""
    from ..auditing.faults.kinds import those
    from ..protocols.compare import rankings
    from ..protocols.task3 import PUBLISHED

    late = {name for name, audit in audits.items()
            if {fault.kind for fault in audit.faults} & those(lambda kind: kind.corrected)}
    several = Counter((row.protocol, row.inputs) for row in body.rows if row.group == "all"
                      and row.clock == AS_RECORDED and row.protocol not in PUBLISHED and late & set(row.flights))
    protocols = list(dict.fromkeys(protocol for (protocol, _), n in several.items() if n > 1))
    if options.clock != AS_RECORDED or not protocols or (methods is not None and not methods):
        return rankings(body.rows)
    moved = replace(options, clock="retimed", quiet=True, out=None, failed=[])
    again = estimate_body(moved, see(moved, flights, audits), protocols, methods, aidings=aidings, further=further)
    return rankings([*body.rows, *again.rows])


def _on_clock(options: Options, seen: Seen, row: EstimateRow) -> EstimateRow:
    """The row with its clock, the streams that set it over the row's flights, and the number of moving clocks."""
    voted, moving = seen.places.evidence_for(row.flights), seen.places.moving(row.flights)
    given, turned = row.given + votes(options.clock, voted, moving > 0), None
    if seen.attitudes is not None and any(name.startswith("attitude") for name in row.metrics):
        turned = seen.attitudes.evidence_for(row.flights)
        given += f" (attitude: {', '.join(turned)})"
    return replace(row, given=given, clock=options.clock, clock_evidence=voted, clock_evidence_attitude=turned,
                   n_moving=None if options.clock == AS_RECORDED else moving)


def _without_logged(options: Options, methods: Sequence[Any], cases: Sequence[Case]
                    ) -> tuple[list[Any], list[Case]]:
    """The methods that are no logged estimate, and the cases without its streams; UsageError when no method is left."""
    from ..protocols.task3 import is_logged

    kept = [method for method in methods if not is_logged(method)]
    if not kept:
        voters(options.clock, JUDGED)  # says why not
    if len(kept) < len(methods):
        options.say("the logged estimate is not judged on clock joint, in which its position may vote")
    return kept, [replace(case, flight=case.flight.without_streams(*LOGGED_STREAMS)) for case in cases]


def _from_files(name: str, files: Mapping[str, Path], cases: Sequence[Case]) -> list[tuple[Any, Case]]:
    """The cases that have a file; InputError when none has."""
    from nanobench_tools.sources.trajectory_file import TrajectoryFile

    found = [(TrajectoryFile(files[case.flight.name]), case) for case in cases if case.flight.name in files]
    if not found:
        raise InputError(f"--trajectory-dir {next(iter(files.values())).parent}",
                         f"no file is called after one of the {len(cases)} flights",
                         f"for example {cases[0].flight.name}.tum")
    return found


def _score(options: Options, protocol: str, work: Sequence[tuple[Any, Case]], seen: Seen,
           out: Path | None, aiding: Aiding | None = None, again: Mapping[str, Case] | None = None
           ) -> tuple[list[EstimateRow], list[FlightScore], list[DrawnBand]]:
    """Run method x flight and write the trajectories: the rows of one protocol, the scores of every flight, and the
    drawing of one flight. ``again``: by name, the flights on the clock that judges attitudes, if it differs."""
    from ..harness import make_item
    from ..protocols import task3, whole_flight
    from ..protocols.result_rows import FlightScore
    from ..protocols.trajectories import score_and_write, write_missing, write_truths
    from ..sources.labels import speed_of

    folder = None if out is None else out / "trajectories"
    how = {} if aiding is None else {"aiding": aiding, "seed": options.seed}
    protocol_given = {} if aiding is None else aiding.to_json()
    given, inputs = ((aiding.given, aiding.inputs) if aiding is not None else
                     (whole_flight.GIVEN, whole_flight.INPUTS) if protocol == task3.WHOLE_FLIGHT else
                     (task3.GIVEN, task3.INPUTS))
    items = [make_item(score_and_write, {"case": case, "method": method, "protocol": protocol, "folder": folder, **how},
                       f"{protocol} {method.name} {case.flight.name}", file=case.flight.provenance.path)
             for method, case in work]
    turned = {}
    for i, (method, case) in enumerate(work):
        if again and case.flight.name in again:
            what = {"case": again[case.flight.name], "method": method, "protocol": protocol, "folder": None, **how}
            turned[i] = make_item(score_and_write, what, f"{protocol} attitude {method.name} {case.flight.name}",
                                  file=case.flight.provenance.path)
    values = options.run([*items, *turned.values()], protocol).values
    done = [(method, case, _with_attitude(values[item.key], values.get(turned[i].key) if i in turned else None, again))
            for i, ((method, case), item) in enumerate(zip(work, items, strict=True)) if item.key in values]
    if folder is not None:
        write_missing(done, protocol, folder, aiding, options.seed)
        write_truths([case for _, case, _ in done], [method.name for method, _, _ in done], folder)
    rows = []
    for name in dict.fromkeys(method.name for method, _, _ in done):
        mine = [(method, case, value) for method, case, value in done if method.name == name]
        rows += task3.tabulate(protocol, mine[0][0], [(case, value) for _, case, value in mine], options.seed,
                               given, options.sessions, protocol_given, inputs)
    rows = _compared(options, [_on_clock(options, seen, row) for row in rows], done)
    worlds = {method.name: angle_deg for method, _, value in done
              if (angle_deg := value.metrics.get("world_turn_deg")) is not None}
    for name, angle_deg in worlds.items():
        options.say(f"{name}: its world is turned by {angle_deg:.1f} deg against that of the motion capture; "
                    "it is scored after the alignment of its positions")
    for name, told in dict.fromkeys((method.name, value.convention) for method, _, value in done if value.convention):
        options.say(f"{name}: {told}")
    single = [FlightScore(protocol, method.name, case.flight.name, speed_of(case.flight), options.clock,
                          protocol_given, value.metrics) for method, case, value in done]
    return rows, single, [] if aiding is None else aided_bands(options, done, aiding)


def _compared(options: Options, rows: Sequence[EstimateRow],
              done: Sequence[tuple[Any, Case, Any]]) -> list[EstimateRow]:
    """With ratios of the rows of one table; the windows of a flight are the same for every method."""
    from ..protocols import compare

    scores: dict[str, dict[str, Metrics]] = {}
    for method, case, value in done:
        scores.setdefault(method.name, {})[case.flight.name] = value.metrics
    return compare.methods(rows, scores, options.sessions.by_name(case.flight for _, case, _ in done), options.seed)


def _with_attitude(value: Scored, turned: Scored | None, again: Mapping[str, Case] | None) -> Scored:
    """``value`` with what it says of attitude from ``turned``, the score on the clock that attitudes are judged on."""
    if not again:
        return value
    return replace(value, metrics={
        name: (turned.metrics.get(name) if turned else None) if name.startswith("attitude") else found
        for name, found in value.metrics.items()})


def _score_blackout(options: Options, work: Sequence[tuple[Any, Case]], seen: Seen
                    ) -> tuple[list[EstimateRow], list[WindowScore], list[DrawnBand]]:
    """The rows of the protocol, its windows, and what is drawn of one of them."""
    from ..harness import make_item
    from ..protocols import blackout
    from ..protocols.result_rows import WindowScore

    items = [make_item(blackout.score, {"case": case, "method": method}, f"blackout {method.name} {case.flight.name}",
                       file=case.flight.provenance.path) for method, case in work]
    values = options.run(items, "blackout").values
    done = [(method, case, values[item.key]) for (method, case), item in zip(work, items, strict=True)
            if item.key in values]
    rows = []
    for name in dict.fromkeys(method.name for method, _, _ in done):
        mine = [(method, case, value) for method, case, value in done if method.name == name]
        rows += blackout.tabulate(mine[0][0], [(case, value) for _, case, value in mine], options.seed,
                                  options.sessions)
    rows = _compared(options, [_on_clock(options, seen, row) for row in rows], done)
    return rows, [WindowScore(case.flight.name, method.name, options.clock, window)
                  for method, case, value in done for window in value.windows], blackout_bands(options, done)

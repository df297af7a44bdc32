"""All cases: two simulators each, diagnosed on real flights; answers are kept, so that a killed run goes on.

Real flights of the vehicle of a case, and the nominal simulator that other flights of the vehicle give.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from identification.mismatch.diagnosis import lift_ratio
from identification.mismatch.wiring import Contradiction, against_flights, impossible
from identification.mismatch.wrench import Wrench
from identification.prove.corrupted.engines import Engine
from identification.prove.corrupted.groups import TRACKS, Group, dealt, groups_of, looked_over
from identification.prove.corrupted.kept_results import READING, code_hash, hashes, kept, key_of
from identification.prove.corrupted.nominal import as_json, from_values
from identification.prove.corrupted.sizes import AHEAD, errors, rise
from identification.prove.corrupted.vehicles import VehicleSource, named, paths_of
from identification.prove.hidden_speed import SPEED, simulator_item
from identification.prove.summary import Share
from nanobench_tools.errors import InputError, NanobenchError, UsageError
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.simulator import loads
from nanobench_tools.results.result import Result, to_json
from nanobench_tools.sources.discover import load_recordings
from nanobench_tools.version import __version__

from .shipped_cases import GEOMETRY, NOT_ASKED, ShippedCase
from .shipped_score import REFUSED, ShippedAnswer, ShippedErrors, ShippedScore, score_shipped

COMMANDS = "brushed_commands"
"""The brushed vehicle as a simulator of motor commands sees it. Rotor speeds make the nominal simulator and its lag.
They are hidden in the flights that are diagnosed."""
MOST_FLIGHTS = 4
"""Of a vehicle: a diagnosis of more takes minutes."""
OF_COMMANDS = ("identification/prove/hidden_speed.py", "identification/motors/*")


def source_of(vehicle: str) -> VehicleSource:
    """Where the recordings of a case are."""
    if vehicle != COMMANDS:
        source = named([vehicle])[0]
        return replace(source, of_a_group=min(source.of_a_group, MOST_FLIGHTS))
    brushed = named(["brushed"])[0]
    return replace(brushed, name=COMMANDS, vehicle=Vehicle(mass_kg=brushed.vehicle.mass_kg))


def group_of(vehicle: str, root: Path, say: Callable[[str], None] = lambda text: None) -> Group | None:
    """The first group of a vehicle, as of ``prove --corrupted``; None where its recordings are absent."""
    source = source_of(vehicle)
    if vehicle == COMMANDS:
        return _commanded(source, root, say)
    found = groups_of(source, root, 1, say)
    return found[0] if found else None


def _commanded(source: VehicleSource, root: Path, say: Callable[[str], None]) -> Group | None:
    hands = dealt(paths_of(source, root), source.groups + 1, [source.train, *([source.of_a_group] * source.groups)])
    if not hands or len(hands[0]) < source.train:
        return None
    train, group = hands[:2]
    say(f"{source.name}: nominal simulator from {len(train)} flights")
    mark = key_of("nominal", source, hashes(train), __version__, code_hash(OF_COMMANDS))

    def fitted() -> dict[str, Any]:
        item = simulator_item(load_recordings(train).flights, source.vehicle.mass_kg, 0)
        return as_json(loads(item["simulator"]))

    nominal = from_values(kept(mark, dict[str, Any], fitted))
    say(f"{source.name}: {len(group)} flights, rotor speed hidden")
    flights = [flight.without_streams(SPEED) for flight in load_recordings(group).flights]
    return Group(source.name, 0, looked_over(flights, source), nominal,
                 key_of(as_json(nominal), hashes(group), code_hash((*READING, *TRACKS))))


QUANTITIES = (("position", "m"), ("velocity", "m/s"), ("attitude", "rad"), ("rate", "rad/s"))
ROW_S = 0.01
LATER = 1
"""Of AHEAD: half a second."""


@dataclass(frozen=True, repr=False)
class ShippedResult(Result):
    """One case of the table.

    - of the case: see ``cases.toml``; credit: source of the recordings; flights: names.
    - score: None where the case is not applicable or its recordings are absent; ``reason`` of that.
    - worst: the prediction error that the shipped value raises most; half_second: all four after half a second."""

    name: str
    number: int
    simulator: str
    what: str
    wrong: str
    right: str
    answer: str
    threads: tuple[str, ...]
    story: str
    made: str
    basis: str
    vehicle: str
    credit: str
    flights: tuple[str, ...]
    judged_s: float | None
    reason: str
    score: ShippedScore | None
    worst: ShippedErrors | None
    half_second: tuple[ShippedErrors, ...]


@dataclass(frozen=True, repr=False)
class ShippedProof(Result):
    """shipped.json.

    - right: of the cases that were judged; identified: of those whose error predictions show.
    - sized: of the identified sizes that are compared.
    - false: cases with an effect that is not there, before or after."""

    engine: str
    seed: int
    right: Share
    identified: Share
    sized: Share
    false: Share
    not_applicable: int
    absent: int
    cases: tuple[ShippedResult, ...]

    @classmethod
    def of(cls, engine: str, seed: int, cases: Sequence[ShippedResult]) -> ShippedProof:
        """Counts of results."""
        scores = [c.score for c in cases if c.score is not None]
        return cls(engine, seed, Share.of(s.right for s in scores), Share.of(s.identified for s in scores if s.visible),
                   Share.of(s.sized for s in scores if s.sized is not None),
                   Share.of(bool(s.false or s.again) for s in scores),
                   sum(c.answer == NOT_ASKED for c in cases),
                   sum(c.score is None and c.answer != NOT_ASKED for c in cases), tuple(cases))


@dataclass
class ShippedJudge:
    """An engine on the flights of the vehicles, each read once."""

    engine: Engine
    roots: Sequence[Path]
    seed: int = 0
    say: Callable[[str], None] = lambda text: None
    groups: dict[str, Group | None] = field(default_factory=dict)

    def group(self, vehicle: str) -> Group | None:
        """Flights of a vehicle, None where they are in no root."""
        if vehicle not in self.groups:
            found = (group_of(vehicle, root, self.say) for root in self.roots)
            self.groups[vehicle] = next((g for g in found if g is not None), None)
        return self.groups[vehicle]

    def answer(self, group: Group, simulator: Model) -> ShippedAnswer:
        """From the cache where the same was diagnosed by the same code."""
        key = key_of("shipped", self.engine.name, self.engine.code, group.key, as_json(simulator), self.seed)
        found: ShippedAnswer = kept(key, ShippedAnswer, lambda: self._answered(group, simulator))
        return found

    def _answered(self, group: Group, simulator: Model) -> ShippedAnswer:
        if (wrong := contradiction(group, simulator)) is not None:
            return ShippedAnswer(GEOMETRY, f"{wrong.key}: {wrong.found}; {wrong.advice}.")
        try:
            verdict: Mapping[str, Any] = to_json(self.engine.diagnose(group.recordings, simulator, self.seed))
        except NanobenchError as error:
            return ShippedAnswer(REFUSED, str(error))
        return ShippedAnswer(verdict["outcome"], verdict["paragraph"], tuple(verdict["findings"]),
                             verdict.get("corrected"))

    def result(self, case: ShippedCase) -> ShippedResult:
        """One case, judged where it can be."""
        if case.answer == NOT_ASKED:
            return _result(case, None, case.reason)
        group = self.group(case.vehicle)
        if group is None:
            return _result(case, None, f"no recordings in {source_of(case.vehicle).folder}")
        corrected = case.as_corrected(group.nominal)
        after = self.answer(group, corrected)
        usual = self.answer(group, group.nominal) if case.basis == "nominal" else None
        shipped: Model | None
        try:
            shipped = case.as_shipped(group.nominal)
            before = self.answer(group, shipped)
        except (InputError, UsageError) as error:  # a value beyond what any vehicle has
            shipped, before = None, ShippedAnswer(REFUSED, str(error))
        lift, shown, table = None, None, None
        if shipped is not None:
            table = _table(group, shipped, before, corrected)
            shown = rise(table[0], table[2])
            if case.known:
                wrench = Wrench(group.recordings.tracks)
                lift = lift_ratio(wrench, corrected) / lift_ratio(wrench, shipped)
        score = score_shipped(case, (shipped, corrected), (before, after), usual, lift, shown)
        return _result(case, group, "", score, table)


def contradiction(group: Group, simulator: Model) -> Contradiction | None:
    """Motor order and spins that cannot fly, or that are not those of the flights: as ``nanobench diagnose`` asks
    before any physics."""
    wrong = impossible(simulator)
    if wrong is None and group.recordings.tracks[0].motor.shape[1] == simulator.rotors:
        wrong = against_flights(Wrench(group.recordings.tracks), simulator)
    return wrong


def _table(group: Group, shipped: Model, before: ShippedAnswer, corrected: Model) -> np.ndarray:
    """(3, 2, 4) errors as shipped, with the identified correction (nan without one), and as the makers corrected."""
    tracks = group.recordings.tracks
    first = errors(shipped, tracks)
    mended = errors(from_values(before.corrected), tracks) if before.corrected else np.full_like(first, np.nan)
    return np.array([first, mended, errors(corrected, tracks)])


def _errors(table: np.ndarray, row: int, k: int) -> ShippedErrors:
    (name, unit), (a, b, c) = QUANTITIES[k], (None if np.isnan(x) else float(x) for x in table[:, row, k])
    return ShippedErrors(name, unit, AHEAD[row] * ROW_S, a, b, c)


def _result(case: ShippedCase, group: Group | None, reason: str, score: ShippedScore | None = None,
            table: np.ndarray | None = None) -> ShippedResult:
    worst, later = None, tuple[ShippedErrors, ...]()
    if table is not None:
        with np.errstate(invalid="ignore"):
            share = table[0] / np.maximum(table[2], 1e-12)
        row, k = np.unravel_index(np.nanargmax(share), share.shape)
        worst = _errors(table, int(row), int(k))
        later = tuple(_errors(table, LATER, i) for i in range(len(QUANTITIES)) if np.isfinite(table[0, LATER, i]))
    return ShippedResult(case.name, case.number, case.simulator, case.what, case.wrong, case.right, case.answer,
                         case.threads, case.story, case.made, case.basis, case.vehicle,
                         source_of(case.vehicle).credit if case.vehicle else "",
                         group.recordings.names if group else (), group.recordings.judged_s if group else None,
                         reason, score, worst, later)


def prove_shipped(judge: ShippedJudge, cases: Sequence[ShippedCase]) -> ShippedProof:
    """The table of these cases."""
    found = []
    for number, case in enumerate(cases):
        judge.say(f"{number + 1} of {len(cases)}: {case.simulator}, {case.what}")
        found.append(judge.result(case))
    return ShippedProof.of(judge.engine.name, judge.seed, found)

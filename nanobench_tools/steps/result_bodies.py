"""Contents of estimate.json, control.json and sysid.json without the envelope, and several parts of one file as one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol, Self

from ..results.result import INLINE, OPTIONAL, Result

if TYPE_CHECKING:
    from identification.greybox.fit_result import FitResult

    from ..metrics.statistics import Summary
    from ..protocols.attribution import Attribution
    from ..protocols.choice import ChosenOn
    from ..protocols.compare import ClockRanking, FlightMeans, GateChange
    from ..protocols.dead_logs import DeadLog
    from ..protocols.gate import GateRow, GateSummary, PicturedFlight
    from ..protocols.published import Published
    from ..protocols.result_rows import EstimateRow, FlightScore, WindowScore
    from ..protocols.sessions import Drawn
    from ..protocols.simulated import ErrorBar, MismatchRow, SampledFlight, SimulatedRow, SolveTimes
    from ..protocols.task1 import PredictionRow
    from ..protocols.task2 import TrackingRow
    from ..protocols.voltage_pairs import VoltagePairs
    from ..results.fitted_values import Estimate, LeftOut
    from ..time_offsets.moving.time_offset import TimeOffset
    from .estimate_pictures import DrawnBand

POINTS_WITHIN_S = 1e-3
"""The result file says a moving error by straight lines within this."""


class Joined(Protocol):
    """A body of which a run makes several."""

    def joined(self, later: Self) -> Self:
        """Rows of both, one after the other; all else from the first that has it."""


@dataclass(frozen=True, repr=False)
class TakenOut(Result):
    """Correction of one flight's timestamps, as in the audit; positive = the timestamps were late.

    Attributes
    ----------
    moving : bool
        Whether a moving error was removed, rather than a constant.
    constant_s : float
        The constant error, s.
    wander_sd_s : float or None
        Standard deviation of the moving error, s.
    reason : str
        The result in one sentence, or why no moving error is accepted.
    evidence : list of str
        Kinds of streams that were used.
    warp : list of tuple
        (t_s, offset_s, sd_s): time, error and its uncertainty, as straight lines.
    """

    moving: bool
    constant_s: float
    wander_sd_s: float | None
    reason: str
    evidence: Sequence[str]
    warp: Sequence[tuple[float, float, float]]

    @classmethod
    def of(cls, offset: TimeOffset) -> TakenOut:
        return cls(offset.moving, offset.constant_s, offset.wander_sd_s, offset.reason, offset.evidence,
                   offset.points(POINTS_WITHIN_S))


@dataclass(frozen=True, repr=False)
class EstimateBody(Result):
    """Content of estimate.json.

    Attributes
    ----------
    rows : list of EstimateRow
        One per protocol, method, group of flights and clock.
    per_flight : list of FlightScore
        Scores of each flight.
    left_out : list of LeftOut
        Recordings in no row, with the reason.
    windows : list of WindowScore
        Scores of each blackout.
    bands : list of DrawnBand
        Errors and standard deviations of one flight, for the page.
    dead_logs : list of DeadLog
        Flights whose log ended in the air.
    clocks : mapping
        By clock and flight, what was removed from its timestamps; null for nothing.
    attribution : Attribution
        Errors of the logged estimate by clock, and of the vehicle's filter run again.
    rankings : list of ClockRanking
        The best method by clock.
    """

    rows: Sequence[EstimateRow]
    per_flight: Sequence[FlightScore]
    left_out: Sequence[LeftOut]
    windows: Sequence[WindowScore] | None = field(default=None, metadata=OPTIONAL)
    bands: Sequence[DrawnBand] | None = field(default=None, metadata=OPTIONAL)
    dead_logs: Sequence[DeadLog] | None = field(default=None, metadata=OPTIONAL)
    clocks: Mapping[str, Mapping[str, TakenOut | None]] | None = field(default=None, metadata=OPTIONAL)
    attribution: Attribution | None = field(default=None, metadata=OPTIONAL)
    rankings: Sequence[ClockRanking] | None = field(default=None, metadata=OPTIONAL)

    def joined(self, later: EstimateBody) -> EstimateBody:
        return replace(self, rows=[*self.rows, *later.rows], per_flight=[*self.per_flight, *later.per_flight],
                       windows=[*(self.windows or ()), *(later.windows or ())] or None,
                       bands=[*(self.bands or ()), *(later.bands or ())] or None,
                       dead_logs=later.dead_logs if self.dead_logs is None else self.dead_logs,
                       clocks={**(self.clocks or {}), **(later.clocks or {})} or None)


@dataclass(frozen=True, repr=False)
class GateJudged(Result):
    """What the gate says of a plant where recordings can judge it."""

    gate_flights: Sequence[PicturedFlight]
    gate_summary: Mapping[str, GateSummary]
    gate_plant: str
    gate_left_out: Sequence[LeftOut]


@dataclass(frozen=True, repr=False)
class GateBody(Result):
    """gate_compared: ratios to the gate on the recordings' own clock."""

    gate: Sequence[GateRow] = ()
    judged: GateJudged | None = field(default=None, metadata=INLINE)
    gate_note: str = field(default="", metadata=OPTIONAL)
    gate_compared: Mapping[str, GateChange] | None = field(default=None, metadata=OPTIONAL)

    @property
    def summary(self) -> Mapping[str, GateSummary] | None:
        return None if self.judged is None else self.judged.gate_summary


@dataclass(frozen=True, repr=False)
class SimulatedPart(Result):
    """Body for the rows of an ensemble of plants."""

    flights: Sequence[SampledFlight]
    solve_times: Sequence[SolveTimes]
    error_bar: ErrorBar | None
    simulated_plant: str


@dataclass(frozen=True, repr=False)
class Lessons(Result):
    """How every network was trained, and the names of the flights that taught, validated and judge."""

    networks: Mapping[str, Mapping[str, Any]] = field(metadata=INLINE)
    train: Sequence[str]
    valid: Sequence[str]
    test: Sequence[str]


@dataclass(frozen=True, repr=False)
class LearnedRow(Result):
    """One controller over n flights on learned dynamics: ``metrics`` are means, ``statistics`` their summaries."""

    plant: str
    controller: str
    reference: str
    speed_m_s: float | None
    information: str
    n: int
    drawn: Drawn = field(metadata=INLINE)
    statistics: Mapping[str, Summary]
    metrics: Mapping[str, float | None]
    published: Published | None = field(metadata=INLINE)


@dataclass(frozen=True, repr=False)
class ControlBody(Result):
    """Content of control.json.

    Attributes
    ----------
    rows : list
        Rows of logged flights, of the ensemble, of plants unlike the model and of learned dynamics, in this order.
    gate : GateBody
        Validation of the simulated plant against logged flights.
    left_out : list of LeftOut
        Recordings in no row, with the reason.
    simulated : SimulatedPart
        The ensemble of plants, its flights and error bar, and times of the solvers.
    mismatch_plant : str
        Origin of the plant that was changed.
    learned : Lessons
        Training of the networks, and the flights that trained, validated and judge.
    voltage_pairs : list of VoltagePairs
        Ratios of controllers over pairs of flights with the same battery voltage.
    """

    rows: Sequence[TrackingRow | SimulatedRow | MismatchRow | LearnedRow] = ()
    gate: GateBody = field(default=GateBody(), metadata=INLINE)
    left_out: Sequence[LeftOut] | None = field(default=(), metadata=OPTIONAL)
    simulated: SimulatedPart | None = field(default=None, metadata=INLINE)
    mismatch_plant: str | None = field(default=None, metadata=OPTIONAL)
    learned: Lessons | None = field(default=None, metadata=OPTIONAL)
    voltage_pairs: Sequence[VoltagePairs] | None = field(default=None, metadata=OPTIONAL)

    def joined(self, later: ControlBody) -> ControlBody:
        return replace(self, rows=[*self.rows, *later.rows])


@dataclass(frozen=True, repr=False)
class ClockModels(Result):
    """The models as they were fitted on one clock; simulator: path of the file of the best one."""

    best: str | None
    best_chosen_on: ChosenOn
    parameters: Mapping[str, Mapping[str, Estimate]]
    simulator: str | None
    simulator_note: str
    fits: Mapping[str, FitResult]


@dataclass(frozen=True, repr=False)
class SysidBody(Result):
    """Content of sysid.json.

    Attributes
    ----------
    rows : list of PredictionRow
        One per model, group of windows and clock.
    per_flight : list of FlightMeans
        Mean errors of each flight.
    parameters_note : str
        What the parameters were fitted to.
    models : ClockModels
        Fitted models on ``clock``: best one, parameters with intervals, path of the simulator.
    split : str
        How flights were divided.
    train, test : list of str
        Names of the flights that were fitted to, and of those that judge.
    left_out : list of LeftOut
        Recordings in no row, with the reason.
    learned : mapping
        Training of the networks.
    clock : str
        Clock of ``models`` where the rows are of several.
    by_clock : mapping
        ``models`` on the other clocks.
    """

    rows: Sequence[PredictionRow]
    per_flight: Sequence[FlightMeans]
    parameters_note: str
    models: ClockModels = field(metadata=INLINE)
    split: str
    train: Sequence[str]
    test: Sequence[str]
    left_out: Sequence[LeftOut]
    learned: Mapping[str, object] | None = field(default=None, metadata=OPTIONAL)
    clock: str = field(default="", metadata=OPTIONAL)
    by_clock: Mapping[str, ClockModels] | None = field(default=None, metadata=OPTIONAL)

    def joined(self, later: SysidBody) -> SysidBody:
        return replace(self, rows=[*self.rows, *later.rows], per_flight=[*self.per_flight, *later.per_flight])

"""Task 1, prediction: windows of every flight, the split into train and test, errors over 50 steps.

Metrics are the published equations: mean over all windows of the error h steps after the start, and its sum over
h = 1..50. Windows are pooled; intervals come from drawing flights.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..auditing.recording_audit import Audit
from ..auditing.selection import apart, distinct
from ..auditing.usable import usable
from ..auditing.verb_needs import SYSID
from ..errors import InputError
from ..flight import Flight, Span, intersect_spans
from ..methods import Prediction, Predictor
from ..metrics.prediction import HORIZONS, QUANTITIES, multi_horizon, window_errors
from ..metrics.statistics import design_effect, pooled_interval
from ..results.result import INLINE, OPTIONAL, Result
from ..sources.labels import family_of, speed_of
from .phases import flown_spans, is_cut
from .published import Published, beside, may_be_published
from .result_rows import ClockRatios, CommandResponse, Ratios
from .sessions import Drawn, Sessions
from .windows import HORIZON, TRUTHS, cut_windows

STREAMS = tuple(SYSID)
JUDGED = ("attitude",)
"""The logged attitude is a truth of this task, so it has no vote in the clock (``moving.votes``)."""
TRAINED = ("circle", "figure_eight", "helix", "oval", "star")
"""Families of the training split."""

BATTERY_V = (3.3, 3.5, 3.7)
"""Windows are also grouped by the battery voltage at their start, between these."""

UNIT_WITHIN = 1e-3
"""Lengths of predicted quaternions differ from 1 by less."""


@dataclass(frozen=True)
class Case:
    """One flight as the task uses it: the clean airborne spans, and its groups. ``recorded``: the flight on its
    original clock, if ``flight`` has another one; only starts that look back use it."""

    flight: Flight
    spans: tuple[Span, ...]
    groups: tuple[str, ...]
    recorded: Flight | None = None


@dataclass(frozen=True, repr=False)
class WindowErrors(Result):
    """Scores of one predictor on one flight: number of windows, and per metric the sums over them of the error at h =
    1..50. For a whole flight also by group of battery voltage."""

    windows: int
    sums: dict[str, list[float]]
    battery: dict[str, WindowErrors] = field(default_factory=dict)


@dataclass(frozen=True, repr=False, kw_only=True)
class PredictionRow(Result):
    """One model on one group of windows.

    Attributes
    ----------
    model : str
        Registered name, or name of a fitted model.
    information : str
        ``state`` (start state and inputs) or ``past`` (also the streams before the start).
    truth : str
        The states that judge: of the onboard estimate or of the motion capture.
    group : str
        ``all``, ``seen`` or ``unseen`` families, a family, a speed, or a range of the battery voltage.
    n_windows, n_flights : int
        Numbers of windows and flights.
    drawn : Drawn
        Basis of the intervals; its design effects are of the flights' means.
    metrics : mapping
        Means over windows, by metric and steps (``1``, ``10``, ``50``; ``sum`` over 1..50).
    ci95 : mapping
        95 % intervals of the same over sessions and flights; null where ``drawn`` gives a reason.
    curve : mapping
        Of group ``all``: error at each step 1..50, by metric.
    published : Published
        The published row for comparison.
    start : str
        Start state of the windows: ``centred`` (stored rows) or ``past`` (only data that had arrived by then).
    ratios : Ratios
        Errors over those of another model on the same windows.
    clock : str
        ``as-recorded``, ``offset`` or ``retimed``.
    clock_evidence : list of str
        Streams that set the clock.
    fit : Fitted or Exported
        Notes on a fitted model: its inputs, and why it is invalid.
    command_response : CommandResponse
        Of group ``all``: change after a step of the command, relative to a rigid body.
    clock_ratios : ClockRatios
        Errors over those of the same model on another clock.
    """

    model: str
    information: str
    truth: str
    group: str
    n_windows: int
    n_flights: int
    drawn: Drawn = field(metadata=INLINE)
    metrics: Mapping[str, Mapping[str, float]]
    ci95: Mapping[str, Mapping[str, tuple[float, float] | None]]
    curve: Mapping[str, list[float]] | None = field(default=None, metadata=OPTIONAL)
    published: Published | None = field(default=None, metadata=INLINE)
    start: str = "centred"
    ratios: Ratios | None = field(default=None, metadata=INLINE)
    clock: str = field(default="", metadata=OPTIONAL)
    clock_evidence: Sequence[str] | None = field(default=None, metadata=OPTIONAL)
    fit: Fitted | Exported | None = field(default=None, metadata=INLINE)
    command_response: CommandResponse | None = field(default=None, metadata=OPTIONAL)
    clock_ratios: ClockRatios | None = field(default=None, metadata=INLINE)

    @property
    def trouble(self) -> str:
        """Why a fit is no result; empty for one that is."""
        return self.fit.trouble if isinstance(self.fit, Fitted) else ""


@dataclass(frozen=True, repr=False)
class Fitted(Result):
    """Notes on a fitted model: why it is invalid, its inputs, and the per-flight parameters of the training flights."""

    trouble: str
    uses: str
    nuisances_in_training: Sequence[str]


@dataclass(frozen=True, repr=False)
class Exported(Result):
    """Of a model as its file holds it."""

    uses: str


@dataclass(frozen=True)
class Split:
    """train and test cases; ``note`` says how they were chosen; left_out: reason by name of test recordings that are
    no test because they share rows with training."""

    train: list[Case]
    test: list[Case]
    note: str
    left_out: Mapping[str, str] = field(default_factory=dict)

    def as_recorded(self, flights: Sequence[Flight]) -> Split:
        """The same with ``recorded`` of every case: its flight, by name, before its streams were moved."""
        by_name = {flight.name: flight for flight in flights}
        train, test = ([replace(case, recorded=by_name.get(case.flight.name)) for case in cases]
                       for cases in (self.train, self.test))
        return replace(self, train=train, test=test)


FEWEST_TO_DIVIDE = 3
"""Flights, each of another trajectory, of which a third can be tested on."""


def split(flights: Sequence[Flight], audits: Mapping[str, Audit]) -> Split:
    """The published kind of split: train on the first flight of each trajectory of the TRAINED families, test on all
    others. ``audits``: by name of the flight. Copies and slices are left out.

    The first is the earliest distinct recording of its trajectory_id (without a sheet: of family and speed), whether or
    not it flew. A piece cut to the flight is never first if there are whole recordings. Where every trajectory was
    flown once, or none is of a TRAINED family, the latest third is tested on. Raises InputError if no test flight
    remains.
    """
    kept, repeats = distinct(flights)
    first: dict[str, Flight] = {}
    whole = [f for f in kept if "motor" in f and not is_cut(f)] or kept
    for flight in sorted(whole, key=lambda f: f.epoch_s):
        if family_of(flight) in TRAINED:
            first.setdefault(_trajectory(flight), flight)
    chosen = {flight.name for flight in first.values()}
    train = _cases([f for f in kept if f.name in chosen], audits, None)
    seen = {family_of(case.flight) for case in train}
    others, shared = apart([f for f in kept if f.name in chosen], [f for f in kept if f.name not in chosen])
    test = _cases(others, audits, seen)
    told = f"train: earliest recording of each trajectory of {', '.join(TRAINED)}; test: the others"
    why, all_cases = "", train
    if not test and not others:
        why = "every trajectory was flown once"
    elif not train:
        why, all_cases = f"no trajectory is one of {', '.join(TRAINED)}", test
    if why and len(all_cases) >= FEWEST_TO_DIVIDE:
        latest = sorted(all_cases, key=lambda case: case.flight.epoch_s)[-(len(all_cases) // FEWEST_TO_DIVIDE):]
        names = {case.flight.name for case in latest}
        train = _cases([case.flight for case in all_cases if case.flight.name not in names], audits, None)
        others, shared = apart([case.flight for case in train], [case.flight for case in latest])
        test = _cases(others, audits, {family_of(case.flight) for case in train})
        told = f"{why}; test: the latest third; train: the others"
    if not test:
        raise _nothing(flights, train, len(shared))
    note = f"{told}; {len(repeats) + len(shared)} copies and slices left out"
    return Split(train, test, note, shared)


def given_split(train: Sequence[Flight], test: Sequence[Flight], audits: Mapping[str, Audit]) -> Split:
    """The user's split. A test recording that shares rows with a training one (copy, slice, or the whole of a slice)
    is left out. So are copies and slices within each."""
    kept_train = distinct(train)[0]
    others, shared = apart(train, test)
    kept_test = distinct(others)[0]
    cases = _cases(kept_train, audits, None)
    chosen = _cases(kept_test, audits, {family_of(case.flight) for case in cases})
    if not chosen and test and len(shared) == len(test):
        raise InputError(test[0].provenance.path, f"all {len(test)} test recordings share rows with training ones",
                         "give others with --test")
    if not chosen:
        raise _nothing(test, [])
    return Split(cases, chosen, f"train and test as given; {len(test) - len(kept_test)} copies and slices left out",
                 shared)


def training_cases(flights: Sequence[Flight], audits: Mapping[str, Audit]) -> list[Case]:
    """Every usable one of ``flights`` as the task would train on it; ``audits`` by name of the flight."""
    return _cases(flights, audits, None)


def _nothing(flights: Sequence[Flight], train: Sequence[Case], shared: int = 0) -> InputError:
    place = flights[0].provenance.path if flights else "data"
    if train:
        return InputError("Task 1", f"no flight is left to test on: all {len(train)} usable flights train"
                                 + (f", {shared} others share rows with them" if shared else ""),
                          "give --train and --test, or more recordings")
    return InputError(place, f"no test flight with {', '.join(STREAMS)} streams and 0.5 s of clean flight among "
                             f"{len(flights)} recordings")


def _trajectory(flight: Flight) -> str:
    return str(flight.metadata.get("trajectory_id") or f"{family_of(flight)} {speed_of(flight)}")


def _cases(flights: Sequence[Flight], audits: Mapping[str, Audit], seen: set[str] | None) -> list[Case]:
    cases = []
    for flight in usable(flights, audits, SYSID):
        audit = audits[flight.name]
        spans = intersect_spans(flown_spans(flight, audit.airborne), audit.clean_for(STREAMS))
        if not any(span.duration_s * 100.0 > HORIZON for span in spans):
            continue
        family = family_of(flight)
        known = () if seen is None else ("seen" if family in seen else "unseen",)
        speed = speed_of(flight)
        groups = ("all", *known, family, *((speed,) if speed else ()))
        cases.append(Case(flight, spans, groups))
    return cases


def score(case: Case, predictor: Predictor, truth: str, start: str = "centred") -> WindowErrors:
    """Scores of one predictor on one flight. ``start``: as in ``cut_windows``. Only predictors of class ``past`` get
    the streams before the start.

    Raises InputError with predictor and flight if the prediction has the wrong shape or is not finite. The same
    applies to quaternions that are not of unit length.
    """
    place = case.flight.provenance.path
    cut = cut_windows(case.flight, case.spans, truth, past=predictor.information == "past", start=start,
                      recorded=case.recorded)
    if cut is None:
        return WindowErrors(0, {name: [0.0] * HORIZON for name in QUANTITIES})
    windows, true = cut
    found = predictor.predict(windows)
    try:
        predicted = Prediction(*(np.asarray(getattr(found, name), float)
                                 for name in ("position_m", "velocity_m_s", "quaternion", "rate_rad_s")))
        errors = window_errors(predicted, true)
    except (AttributeError, TypeError, ValueError) as error:
        raise InputError(place, f"predictor {predictor.name} gave no prediction that can be scored: {error}") from None
    if not all(np.isfinite(e).all() for e in errors.values()):
        raise InputError(place, f"predictor {predictor.name} predicted a state that is not finite")
    norm = np.linalg.norm(predicted.quaternion, axis=-1)
    if not np.all(np.abs(norm - 1.0) < UNIT_WITHIN):  # the angle of a zero quaternion to any other would be zero
        worst = norm.flat[int(np.argmax(np.abs(norm - 1.0)))]
        raise InputError(place, f"predictor {predictor.name} predicted a quaternion of length {worst:.4g}",
                         f"lengths have to be 1 within {UNIT_WITHIN}")
    level = np.searchsorted(BATTERY_V, windows.battery_V[:, 0])
    return replace(_sums(errors, np.ones(len(windows), bool)),
                   battery={battery_group(i): _sums(errors, level == i) for i in np.unique(level)})


def _sums(errors: Mapping[str, np.ndarray], mine: np.ndarray) -> WindowErrors:
    return WindowErrors(int(mine.sum()), {name: e[mine].sum(axis=0).tolist() for name, e in errors.items()})


def battery_group(level: int) -> str:
    """Name of the windows whose battery voltage lies between BATTERY_V[level - 1] and [level].

    >>> battery_group(0), battery_group(1)
    ('battery below 3.3 V', 'battery 3.3-3.5 V')
    """
    if not 0 < level < len(BATTERY_V):
        return f"battery {'above' if level else 'below'} {BATTERY_V[level and -1]} V"
    return f"battery {BATTERY_V[level - 1]}-{BATTERY_V[level]} V"


def tabulate(predictor: Predictor, truth: str, scored: Sequence[tuple[Case, WindowErrors]],
             seed: int = 0, sessions: Sessions | None = None, start: str = "centred") -> list[PredictionRow]:
    """Rows by group: ``all``, seen and unseen families, each family, each speed, and battery voltages at the start of
    the windows. ``sessions``: of all recordings of the run; None: of the scored ones alone. With the published
    start, the published table is added to recordings in its format."""
    rows = []
    scored = [(case, value) for case, value in scored if value.windows]
    sessions = sessions or Sessions.of(case.flight for case, _ in scored)
    ranks = max((len(case.groups) for case, _ in scored), default=0)
    groups = [g for rank in range(ranks) for case, _ in scored for g in case.groups[rank:rank + 1]]
    levels = sorted({g for _, value in scored for g in value.battery}, key=_battery_rank)
    for group in dict.fromkeys([*groups, *levels]):
        found = [(case, value) for case, value in scored if group in case.groups] or [
            (case, value.battery[group]) for case, value in scored if group in value.battery]
        members, labels = [value for _, value in found], sessions.labels(case.flight for case, _ in found)
        counts = np.array([value.windows for value in members])
        metrics, intervals, effects = {}, {}, {}
        for name in QUANTITIES:
            sums = np.array([value.sums[name] for value in members])
            with_total = np.concatenate([sums, sums.sum(axis=1, keepdims=True)], axis=1)
            metrics[name] = multi_horizon(sums.sum(axis=0) / counts.sum())
            keys = {**{str(h): h - 1 for h in HORIZONS}, "sum": HORIZON}
            shown = with_total[:, list(keys.values())]
            interval = pooled_interval(shown, counts, labels, seed)
            effect = design_effect(shown / counts[:, None], labels)
            intervals[name] = {key: interval.ends(i) for i, key in enumerate(keys)}
            effects[name] = {key: None if effect is None else float(effect[i]) for i, key in enumerate(keys)}
        curve = {name: (np.sum([value.sums[name] for value in members], axis=0) / counts.sum()).tolist()
                 for name in QUANTITIES} if group == "all" else None
        as_published = ((truth, group, start) == ("onboard", "all", "centred")
                        and may_be_published(case.flight for case, _ in found))
        rows.append(PredictionRow(
            model=predictor.name, information=predictor.information, truth=truth, group=group,
            n_windows=int(counts.sum()), n_flights=len(members), metrics=metrics, ci95=intervals,
            drawn=Drawn(interval.sessions, effects, interval.why), curve=curve, start=start,
            published=beside("task1", "models", predictor.name) if as_published else None))
    return rows


def _battery_rank(group: str) -> int:
    return [battery_group(i) for i in range(len(BATTERY_V) + 1)].index(group)


__all__ = ["HORIZON", "STREAMS", "TRAINED", "TRUTHS", "Case", "Split", "given_split", "score", "split", "tabulate",
           "training_cases"]

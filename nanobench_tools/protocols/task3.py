"""Task 3, estimation: what each protocol gives to an estimator, which rows are scored, and how.

``as-published``: the published table with its faults. ``as-published-corrected``: the same recordings and formulas
with the three faults mended (log tails cut, copies dropped, one unit for angles). ``clean``: every distinct
recording, airborne and free of logging faults. All functions are pure: flights and audits in, results out.
"""

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeGuard

import numpy as np
from scipy.spatial.transform import Rotation

from .. import so3
from ..auditing.faults.kinds import cutting_logs
from ..auditing.recording_audit import Audit
from ..auditing.selection import distinct, without_copies
from ..auditing.usable import POSE, Needed, cut_by, flown, missing, stuck_clock, tidy, usable
from ..auditing.verb_needs import ESTIMATE, LOGGED, TRUTH
from ..errors import InputError, unknown_name
from ..flight import Flight, Span, intersect_spans, make_stream, subtract_spans
from ..flight import mask_of as inside
from ..methods import Estimate, Estimator
from ..metrics.alignment import Alignment, AlignmentError, align
from ..metrics.association import associate, snap
from ..metrics.attitude import published_euler_rmse_deg
from ..metrics.trajectory import ate
from ..signals.derived_velocity import has_velocity, with_velocity
from ..signals.onboard_estimate import OnboardEkf
from ..sources.labels import FILTERS_SEARCHED_ON, OTHER_FAMILIES, family_of, speed_of
from ..sources.trajectory_file import TrajectoryFile
from .foreign_conventions import convention_of
from .phases import MOTOR_ON, flown_spans, is_cut
from .published import beside
from .result_rows import EstimateRow, Scored
from .score_tables import group_order, groups_of, summaries
from .scoring3 import (
    attitude_metrics,
    consistency_metrics,
    further_metrics,
    progress_metrics,
    published_metrics,
    velocity_residuals,
)
from .sessions import Drawn, Sessions

PROTOCOLS = ("as-published", "as-published-corrected", "clean")
BLACKOUT, AIDED, WHOLE_FLIGHT = "blackout", "aided", "whole-flight"
"""Same recordings as ``clean``, with other inputs and scores (``blackout``, ``aided``, ``whole_flight``). They run
only on request."""

KNOWN = (*PROTOCOLS, AIDED, BLACKOUT, WHOLE_FLIGHT)
PUBLISHED = PROTOCOLS[:2]
STREAMS = ("mocap", "estimator", "attitude", "attitude_qw")
"""The streams the task is about."""


GIVEN_S = 0.5
GIVEN = f"motion capture poses until {GIVEN_S} s after the start of the flight (not scored), all other streams"
GIVEN_LOGGED = "as flown: motion capture poses over radio, own sensors"
INPUTS = f"poses of the first {GIVEN_S:g} s"
INPUTS_LOGGED = "all poses, in flight"
MINIMUM_ROWS = 50

OTHER_WORLD_RAD = np.radians(5.0)
"""Minimum rotation of a trajectory's world at which it is a different convention. A smaller one is an error."""

COVERED = 0.95
NEAR_S = 0.1
"""A truth timestamp is covered if the estimate has a timestamp within NEAR_S. What covers less than COVERED is scored
there and ranked against no other, because errors grow with time."""
FEWEST_POSES = 10
"""An alignment has six degrees of freedom: with 10 poses (30 numbers) it hides a tenth of a random error."""
ROUNDING = 1e-12
"""Smaller errors (m, deg, s) are those of floating-point numbers."""
DERIVED = "velocity of the truth derived from its positions"
"""Note on a flight whose motion capture has no velocity."""


@dataclass(frozen=True)
class Case:
    """One recording as a protocol uses it: the flight, the spans whose rows are scored, its groups, and a note on the
    choice."""

    flight: Flight
    spans: tuple[Span, ...]
    groups: tuple[str, ...]
    note: str = ""


def check_protocol(name: str) -> None:
    """UsageError that lists the protocols there are."""
    if name not in KNOWN:
        raise unknown_name("protocol", name, KNOWN)


def select(flights: Sequence[Flight], audits: Mapping[str, Audit], protocol: str,
           needed: Needed | None = None) -> list[Case]:
    """The cases of a protocol, in the order of ``flights``; ``audits`` by name of the flight.

    needed: streams a recording has to have; None: those of the published protocol, of all others the poses alone.
    Velocity that a motion capture lacks is derived. Raises InputError when no recording has the streams and rows.
    """
    check_protocol(protocol)
    needed = needed or (ESTIMATE if protocol in PUBLISHED else TRUTH)
    found = usable(flights, audits, needed)
    derived = {flight.name for flight in found if not has_velocity(flight)}
    fit = [tidy(with_velocity(flight), ESTIMATE) for flight in found]
    cases = _published(fit, audits, protocol) if protocol in PUBLISHED else _clean(fit, audits)
    cases = [replace(case, note="; ".join(filter(None, (case.note, DERIVED)))) if case.flight.name in derived else case
             for case in cases]
    if protocol in (AIDED, BLACKOUT, WHOLE_FLIGHT):
        cases = _apart(cases)
    if not cases:
        what = "trefoil recording" if protocol in PUBLISHED else "flight"
        place = ", ".join(sorted({f.provenance.path for f in flights})[:1]) or "data"
        cuts = {f.name: cut for f in fit if (cut := cut_by(audits[f.name], needed))}
        if cuts and len(cuts) == len(fit):
            raise InputError(place, f"no {what} is left for protocol {protocol!r} among {len(flights)} recordings: "
                                    + "; ".join(f"{n} {cut}" for cut, n in Counter(cuts.values()).most_common(3)),
                             "nanobench audit shows the faults")
        if all(stuck := [stuck_clock(f, needed) for f in flights]):
            raise InputError(place, f"no {what} for protocol {protocol!r} among {len(flights)} recordings: {stuck[0]}")
        lacks = Counter(lack for f in flights if (lack := missing(f, needed)))
        raise InputError(place, f"no {what} for protocol {protocol!r} among {len(flights)} recordings"
                         + "".join(f"; {lack} in {n}" for lack, n in lacks.most_common(3)),
                         "poses of a motion capture are needed" if needed == TRUTH else
                         "an estimate from elsewhere is scored with --trajectory-dir DIR" if needed == LOGGED else
                         "it needs motion capture, the onboard estimate, its attitude and the motors' commands")
    return cases


def _published(flights: Sequence[Flight], audits: Mapping[str, Audit], protocol: str) -> list[Case]:
    """Trefoil recordings already cut to the flight; without any, the rows with motors on of all recordings."""
    cut = [f for f in flights if is_cut(f) and family_of(f) == "trefoil" and "attitude" in f]
    note = ""
    if not cut:
        cut = [f for f in flights if "attitude" in f]
        note = "no recordings cut to the flight in the data: rows with motor 1 above 1000 of all recordings instead"
    if protocol == "as-published-corrected":
        cut = without_copies(cut)[0]
    cases = []
    for flight in cut:
        speed = speed_of(flight)
        motor = flight["motor"]
        on = motor["m1"] > MOTOR_ON
        if speed is None or not on.any():
            continue
        spans = _runs(motor.time_s, on)
        if protocol == "as-published-corrected":
            spans = intersect_spans(spans, _logged(audits[flight.name]))
        if np.sum(inside(spans, flight["mocap"].time_s)) >= MINIMUM_ROWS:
            cases.append(Case(flight, spans, (speed.capitalize(),), note))
    return cases


def _clean(flights: Sequence[Flight], audits: Mapping[str, Audit]) -> list[Case]:
    kept, repeats = distinct(flights)
    note = f"{len(repeats)} copies and slices left out" if repeats else ""
    cases = []
    for flight in kept:
        audit = audits[flight.name]
        spans = intersect_spans(flown_spans(flight, flown(flight, audit)), _logged(audit))
        if np.sum(inside(spans, flight["mocap"].time_s)) >= MINIMUM_ROWS:
            cases.append(Case(flight, spans, tuple(groups_of(family_of(flight), speed_of(flight))), note))
    return cases


def _apart(cases: Sequence[Case]) -> list[Case]:
    """With OTHER_FAMILIES among the groups, where not all flights are of these."""
    others = [family_of(case.flight) not in FILTERS_SEARCHED_ON for case in cases]
    if all(others):
        return list(cases)
    return [replace(case, groups=(*case.groups, OTHER_FAMILIES)) if other else case
            for case, other in zip(cases, others, strict=True)]


def _logged(audit: Audit) -> tuple[Span, ...]:
    """Where truth is good and the estimator's streams hold what it said."""
    return intersect_spans(audit.clean_for(["mocap"]), audit.clean_for(STREAMS, cutting_logs()))


def _runs(time_s: np.ndarray, on: np.ndarray) -> tuple[Span, ...]:
    """Spans from the first to the last row of each run of True; a single row is a span of no length."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    return tuple(Span(float(time_s[a]), float(time_s[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True))


def is_logged(method: Estimator) -> TypeGuard[OnboardEkf]:
    """Whether ``method`` is the vehicle's estimate in flight. A user's method never is, even with such attributes."""
    return type(method) is OnboardEkf


def given_to(case: Case, method: Estimator | None = None) -> Flight:
    """The flight as ``method`` (None: any user's) gets it. It has poses until GIVEN_S after the start of the first
    span, and no rows after the last. Estimates logged in flight get no motion capture."""
    start, end = case.spans[0].start_s, case.spans[-1].end_s
    cut = case.flight.without_streams("mocap").during(Span(-np.inf, end))
    if method is not None and is_logged(method):
        return cut
    mocap = case.flight["mocap"]
    early = (mocap.time_s <= start + GIVEN_S) & np.isfinite(mocap[POSE]).all(axis=1)
    poses = make_stream("mocap", mocap.time_s[early], mocap[POSE][early], POSE, rate_hz=mocap.rate_hz)
    return replace(cut, streams={"mocap": poses, **cut.streams})


def checked(estimate: Estimate, method: str, place: str) -> Estimate:
    """The estimate with float arrays; InputError that names method and recording if it is no trajectory."""
    try:
        time_s = np.asarray(estimate.time_s, float)
        position, quaternion = np.asarray(estimate.position_m, float), np.asarray(estimate.quaternion, float)
        velocity = getattr(estimate, "velocity_m_s", None)
        velocity = None if velocity is None else np.asarray(velocity, float)
    except (AttributeError, TypeError, ValueError) as error:
        found = f"estimator {method} gave no time_s, position_m (n, 3) and quaternion (n, 4): {error}"
        raise InputError(place, found) from None
    n = len(time_s) if time_s.ndim == 1 else -1
    shapes = (position.shape, quaternion.shape, (n, 3) if velocity is None else velocity.shape)
    if shapes != ((n, 3), (n, 4), (n, 3)):
        raise InputError(place, f"estimator {method} gave time_s {time_s.shape} with position_m {position.shape}, "
                                f"quaternion {quaternion.shape}", "all need the same number of rows")
    if n and not (np.isfinite(time_s).all() and np.all(np.diff(time_s) > 0.0)):
        raise InputError(place, f"estimator {method} gave times that do not rise")
    finite = np.isfinite(position).all(axis=1) & np.isfinite(quaternion).all(axis=1)
    norm = np.linalg.norm(quaternion, axis=1)
    if not (finite.all() and np.all(norm > 1e-6)):
        row = int(np.argmin(finite & (norm > 1e-6)))
        raise InputError(place, f"estimator {method} gave no pose at {time_s[row]:.3f} s (row {row})")
    if getattr(estimate, "converged", None) is False:
        raise InputError(place, f"estimator {method} did not converge", "no result is taken from it")
    reported = (getattr(estimate, name, None) for name in ("covariance", "nis", "nis_dof", "converged"))
    return Estimate(time_s, position, quaternion / norm[:, None], velocity, *reported)


def covered(time_s: np.ndarray, truth_time_s: np.ndarray) -> float:
    """Part of the timestamps (m,) of the truth that have one of ``time_s`` (n,), rising, within NEAR_S; 1 without
    truth."""
    if not len(time_s) or not len(truth_time_s):
        return float(not len(truth_time_s))
    after = np.clip(np.searchsorted(time_s, truth_time_s), 0, len(time_s) - 1)
    away = np.minimum(np.abs(time_s[after] - truth_time_s), np.abs(time_s[np.maximum(after - 1, 0)] - truth_time_s))
    return float(np.mean(away <= NEAR_S + 1e-9))


def stretches(time_s: np.ndarray) -> tuple[Span, ...]:
    """The spans of rising timestamps (n,) s without a hole: longer than 2 NEAR_S and three usual steps."""
    steps = np.diff(time_s)
    longest = max(2.0 * NEAR_S, 3.0 * float(np.median(steps))) if len(steps) else 0.0
    edges = [-1, *np.flatnonzero(steps > longest).tolist(), len(time_s) - 1]
    return tuple(Span(float(time_s[a + 1]), float(time_s[b])) for a, b in itertools.pairwise(edges))


def _scored_rows(case: Case, estimate: Estimate, method: Estimator,
                 given_s: float) -> tuple[tuple[Span, ...], np.ndarray, float]:
    """(spans, (n,) bool over the estimate's rows, fraction of the flight 0..1) that are scored. Raises InputError for
    fewer than FEWEST_POSES rows.

    An estimate logged in flight is scored on its rows, with fraction 1. For all others the fraction counts after the
    poses given until ``given_s``, and a method that got them is not scored there. The author of a trajectory file knows
    its inputs: all of it is scored.
    """
    if is_logged(method):
        return case.spans, inside(case.spans, estimate.time_s), 1.0
    file = isinstance(method, TrajectoryFile)
    spans = case.spans if file else subtract_spans(case.spans, [Span(-np.inf, given_s)])
    mocap_s = case.flight["mocap"].time_s
    rows = inside(spans, estimate.time_s) & (file | (estimate.time_s > given_s))
    found = covered(estimate.time_s[rows], mocap_s[inside(spans, mocap_s) & (file | (mocap_s > given_s))])
    if isinstance(method, TrajectoryFile) and rows.sum() < FEWEST_POSES:
        raise InputError(str(method.path), _apart_in_time(case, estimate, rows),
                         "timestamps are seconds since 1970, or as in the recording")
    if rows.sum() < FEWEST_POSES:
        raise InputError(case.flight.provenance.path,
                         f"estimator {method.name} has {np.sum(rows)} timestamps in the scored part of the flight and "
                         f"covers {100.0 * found:.1f} % of it, {FEWEST_POSES} timestamps are needed",
                         f"a timestamp every {2.0 * NEAR_S} s or more often, in seconds from the recording's first row")
    return intersect_spans(spans, stretches(estimate.time_s[rows])), rows, found


def _apart_in_time(case: Case, estimate: Estimate, rows: np.ndarray) -> str:
    """How a trajectory and the scored part of the flight lie in time, where too few of its timestamps fall into it."""
    zero, n = case.flight.epoch_s, int(np.sum(rows))
    runs = f"it runs from {zero + estimate.time_s[0]:.3f} to {zero + estimate.time_s[-1]:.3f} s"
    return (f"{n} of {len(rows)} timestamps lie in the scored part of the flight, {FEWEST_POSES} are needed: {runs}, "
            f"that part from {zero + case.spans[0].start_s:.3f} to {zero + case.spans[-1].end_s:.3f} s")


def score(case: Case, method: Estimator, protocol: str) -> Scored:
    """Raw scores of one estimator on one recording. Raises InputError when nothing can be scored."""
    return score_given(case, method, protocol, given_to(case, method), case.spans[0].start_s + GIVEN_S)


def score_given(case: Case, method: Estimator, protocol: str, flight: Flight, given_s: float) -> Scored:
    """``score`` of the estimate that ``method`` makes of ``flight``, on the case's rows after ``given_s``."""
    place = case.flight.provenance.path
    estimate = checked(method.estimate(flight), method.name, place)
    mocap = case.flight["mocap"]
    estimate = replace(estimate, time_s=snap(estimate.time_s, mocap.time_s))
    spans, rows, share = _scored_rows(case, estimate, method, given_s)
    truth = associate(estimate.time_s[rows], mocap.time_s, mocap["px", "py", "pz"],
                      mocap["qx", "qy", "qz", "qw"], mocap["vx", "vy", "vz"])
    rows = np.flatnonzero(rows)[truth.kept]
    if len(rows) < 3:
        raise InputError(place, f"estimator {method.name} has {len(rows)} timestamps in the scored part of the flight",
                         "times are seconds from the first row of the recording")
    truth_m_s = np.asarray(truth.velocity_m_s)
    t, p, q = estimate.time_s[rows], estimate.position_m[rows], estimate.quaternion[rows]
    v = None if estimate.velocity_m_s is None else estimate.velocity_m_s[rows]
    world = world_of(p, truth.position_m) if isinstance(method, TrajectoryFile) else None
    raw = p
    if world is not None:  # errors that depend on the world are those in the truth's
        p, q = world.apply(p), so3.multiply(Rotation.from_matrix(world.rotation).as_quat(), q)
        v = None if v is None else v @ world.rotation.T
    metrics = published_metrics(p, truth.position_m, v, truth_m_s)
    if protocol == "as-published":
        euler = method.logged_euler(flight)[rows] if is_logged(method) else so3.euler_zyx(q)
        firmware_deg = np.degrees(euler) * [1.0, -1.0, 1.0]  # the firmware's pitch is positive nose up
        metrics["attitude_rmse_deg"] = published_euler_rmse_deg(firmware_deg, _mocap_euler(case.flight, t))
    else:
        metrics |= attitude_metrics(q, truth.quaternion)
        metrics |= further_metrics(t, p, q, truth.position_m, truth.quaternion, truth_m_s, spans)
        metrics |= velocity_residuals(v, truth_m_s) | progress_metrics(t, p, truth.position_m)
        metrics |= consistency_metrics(estimate, rows, truth.position_m)
    if not is_logged(method):
        metrics["covered_percent"] = 100.0 * share
    if world is not None:
        metrics["world_turn_deg"] = float(np.degrees(world.angle_rad))
        if "ate_unaligned_rmse_m" in metrics:
            metrics["ate_unaligned_rmse_m"] = ate(raw, truth.position_m, "none").rmse_m
    metrics = {name: 0.0 if abs(value) < ROUNDING else value for name, value in metrics.items()}
    convention = ""
    if isinstance(method, TrajectoryFile):
        convention = convention_of(p, estimate.quaternion[rows], np.eye(3) if world is None else world.rotation,
                                   truth.position_m, truth.quaternion)
    return Scored(metrics, len(rows), truth.dropped, np.column_stack([t, p, q]), convention)


def world_of(estimate_m: np.ndarray, truth_m: np.ndarray) -> Alignment | None:
    """The motion that takes a trajectory (n, 3) m of another program into the world of the truth (n, 3) m; None where
    it is in that world already, to within OTHER_WORLD_RAD, or where the path does not determine it."""
    try:
        found = align(estimate_m, truth_m)
    except AlignmentError:
        return None
    return found if found.angle_rad > OTHER_WORLD_RAD else None


def _mocap_euler(flight: Flight, at_s: np.ndarray) -> np.ndarray:
    """Roll, pitch, yaw of the truth (k, 3) rad; the recording's own columns where it has them and the timestamps
    agree."""
    mocap = flight["mocap"]
    names = ("roll", "pitch", "yaw")
    at = np.searchsorted(mocap.time_s, at_s)
    if all(n in mocap for n in names) and np.array_equal(mocap.time_s[np.minimum(at, len(mocap) - 1)], at_s):
        return mocap[names][at]
    return so3.euler_zyx(so3.interpolate(mocap.time_s, mocap["qx", "qy", "qz", "qw"], at_s))


def given_and_trained(method: Estimator, given: str) -> str:
    """Inputs of a method in words (its ``given``, else that of the protocol). Also its training data, if it has
    ``trained_on``."""
    reported = str(getattr(method, "given", given))
    return f"{reported}; {trained}" if (trained := getattr(method, "trained_on", "")) else reported


def inputs_of(method: Estimator, inputs: str, covered_percent: float | None = None) -> str:
    """Inputs of a method, in short. Only methods with the same inputs may be ranked against each other; those that
    cover a part of the flights are not ranked."""
    if is_logged(method):
        return INPUTS_LOGGED
    same = str(getattr(method, "given", inputs))
    same = same if getattr(method, "causal", True) is not False else f"{same}, later ones too"
    part = covered_percent is not None and covered_percent < 100.0 * COVERED
    return f"{same}; {method.name} covers {covered_percent:.0f} %" if part else same


def tabulate(protocol: str, method: Estimator, scored: Sequence[tuple[Case, Scored]], seed: int = 0,
             given: str = GIVEN, sessions: Sessions | None = None, aiding: Mapping[str, float] | None = None,
             inputs: str = INPUTS) -> list[EstimateRow]:
    """Rows of one method, one per group. sessions: of all recordings of the run; None: of the scored ones alone."""
    rows = []
    known = is_logged(method)
    sessions = sessions or Sessions.of(case.flight for case, _ in scored)
    for group in group_order([g for case, _ in scored for g in case.groups]):
        members = [(case, value) for case, value in scored if group in case.groups]
        notes = dict.fromkeys(case.note for case, _ in members if case.note)
        labels = sessions.labels(case.flight for case, _ in members)
        metrics = summaries([value.metrics for _, value in members], seed, labels)
        as_was = protocol == "as-published" and known and not notes
        rows.append(EstimateRow(
            protocol=protocol, method=method.name, causal=getattr(method, "causal", None), group=group, n=len(members),
            flights=[case.flight.name for case, _ in members],
            given="; ".join([GIVEN_LOGGED if known else given_and_trained(method, given), *notes]),
            inputs=inputs_of(method, inputs, shares.mean if (shares := metrics.get("covered_percent")) else None),
            dropped_stamps=sum(value.dropped for _, value in members), drawn=Drawn.of(labels, metrics), metrics=metrics,
            published=beside("task3", "groups", group) if as_was else None, aiding=aiding or {}))
    return rows

"""Task 2, control on logged flights (plant ``real``): the published rows, and the flights scored as they should be.

As published: from the first to the last row with a setpoint, including take-off, landing and the wait on the ground.
Log tails are not cut, and setpoint degrees are taken for radians. Corrected: only the phase in which a path is
streamed, where the logs are good. Both are ``as flown``: the controllers got position setpoints without derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .. import so3
from ..auditing.faults.kinds import cutting_logs
from ..auditing.recording_audit import Audit
from ..auditing.selection import distinct
from ..auditing.usable import usable
from ..auditing.verb_needs import CONTROL
from ..errors import InputError, unknown_name
from ..flight import Flight, Span, intersect_spans
from ..flight import mask_of as inside
from ..metrics import tracking
from ..metrics.statistics import Summary
from ..metrics.trajectory import rms, velocity_rmse
from ..results.result import INLINE, OPTIONAL, Result
from ..sources.labels import UNKNOWN, family_of, speed_of
from .phases import is_cut, tracking_spans
from .published import Published, beside
from .score_tables import summaries
from .sessions import Drawn, Sessions

PROTOCOLS = ("as-published", "clean")
CONTROLLERS = ("pid", "mellinger")
"""Those of the firmware; the published rows know no other."""
UNNAMED = ("none", "unknown")
"""What the audit says when it cannot name a controller."""
PUBLISHED = ("trefoil", "medium")
"""Family and speed of the published rows."""


SETPOINT_M = 0.05
DROPPED_ABOVE_M = 1.0
MINIMUM_S = 5.0


Group = tuple[str, str, str | None, str]
"""Protocol, reference, speed and controller of a row."""


@dataclass(frozen=True)
class Case:
    """One recording as a protocol uses it. ``spans`` are the streamed phase where logs are good (empty for the
    published rows); ``reference`` and ``speed`` name the row it counts in."""

    flight: Flight
    controller: str
    protocol: str
    spans: tuple[Span, ...]
    reference: str
    speed: str | None


@dataclass(frozen=True, repr=False)
class Tracked(Result):
    """Scores of one recording over so many rows; reference_speed_m_s: the median speed of its setpoints."""

    rows: int
    metrics: Mapping[str, float | None]
    reference_speed_m_s: float | None = None


@dataclass(frozen=True, repr=False)
class TrackingRow(Result):
    """One controller as flown, over n flights.

    Attributes
    ----------
    plant : str
        ``real``, or the simulated plant.
    protocol : str
        As for ``nanobench control``.
    controller : str
        That flew, or the registered name.
    reference : str
        Trajectory family.
    speed : str or None
        ``slow``, ``medium`` or ``fast``, where the sheet has it.
    speed_m_s : float or None
        Of the reference.
    information : str
        What the controller knows of the reference.
    n : int
        Number of flights.
    flights : list of str
        Their names.
    dropped : list of str
        Flights that the published rows leave out, with an RMSE above DROPPED_ABOVE_M.
    drawn : Drawn
        Basis of the intervals: number of sessions, design effects, and why an interval is missing or too narrow.
    metrics : mapping
        Means over flights by metric, whose name ends in its unit.
    statistics : mapping
        Statistics over flights by metric.
    published : Published
        The published row for comparison.
    clock : str
        ``as-recorded``, ``offset`` or ``retimed``.
    clock_evidence : list of str
        Streams that set the clock.
    """

    plant: str
    protocol: str
    controller: str
    reference: str
    speed: str | None
    speed_m_s: float | None
    information: str
    n: int
    flights: Sequence[str]
    dropped: Sequence[str]
    drawn: Drawn = field(metadata=INLINE)
    metrics: Mapping[str, float | None]
    statistics: Mapping[str, Summary]
    published: Published | None = field(default=None, metadata=INLINE)
    clock: str = field(default="", metadata=OPTIONAL)
    clock_evidence: Sequence[str] | None = field(default=None, metadata=OPTIONAL)


def check_protocol(name: str) -> None:
    """UsageError that lists the protocols there are."""
    if name not in PROTOCOLS:
        raise unknown_name("protocol", name, PROTOCOLS)


def select(flights: Sequence[Flight], audits: Mapping[str, Audit], protocol: str) -> list[Case]:
    """The cases of a protocol; ``audits`` by name of the flight. Copies and slices of other recordings are left out.

    as-published: whole recordings of the medium trefoil. clean: every recording in which a path was streamed.
    Raises InputError if it is missing.
    """
    check_protocol(protocol)
    fit = usable(distinct(flights)[0], audits, CONTROL)
    if protocol == "as-published":
        fit = [f for f in fit if not is_cut(f) and (family_of(f), speed_of(f)) == PUBLISHED]
        fit = [f for f in fit if audits[f.name].controller in CONTROLLERS]
    fit = [f for f in fit if audits[f.name].controller not in UNNAMED]
    cases = [case for flight in fit for case in _cases(flight, audits[flight.name], protocol)]
    if not cases and protocol == "as-published":
        raise InputError(f"{len(flights)} recording{'s' * (len(flights) != 1)}",
                         f"no whole flight of the published {' '.join(reversed(PUBLISHED))} under "
                         f"{' or '.join(CONTROLLERS)}", "--protocol clean scores every path")
    if not cases:
        raise InputError(flights[0].provenance.path if flights else "data",
                         f"no flight of a known controller with motion capture, setpoint and motor streams for "
                         f"protocol {protocol!r} among {len(flights)} recordings",
                         "the pid stream or the sheet shows the controller (docs/own_methods.md)")
    return cases


def _cases(flight: Flight, audit: Audit, protocol: str) -> list[Case]:
    if protocol == "as-published":
        return [Case(flight, audit.controller, protocol, (), protocol, speed_of(flight))]
    logged = audit.clean_for(["setpoint", "motor"], cutting_logs())
    valid = intersect_spans(audit.clean_for(["mocap"]), logged)
    spans = tracking_spans(flight, valid)
    if sum(s.duration_s for s in spans) < MINIMUM_S:
        return []
    family = family_of(flight)
    return [Case(flight, audit.controller, protocol, spans, family if family != UNKNOWN else "path", speed_of(flight))]


def score(case: Case) -> Tracked:
    """Of one recording."""
    return score_published(case.flight) if case.protocol == "as-published" else score_tracking(case)


def _rows(flight: Flight) -> tuple[np.ndarray, ...]:
    """time_s (n,), position, velocity, setpoint (n, 3), yaw, setpoint yaw (n,) at the motion capture's rows, SI."""
    mocap, setpoint = flight["mocap"], flight["setpoint"]
    yaw = mocap["yaw"] if "yaw" in mocap else so3.euler_zyx(mocap["qx", "qy", "qz", "qw"])[:, 2]
    target = setpoint.interpolate(("x", "y", "z"), mocap.time_s)
    target_yaw = setpoint.interpolate("yaw", mocap.time_s) if "yaw" in setpoint else np.zeros(len(mocap))
    return mocap.time_s, mocap["px", "py", "pz"], mocap["vx", "vy", "vz"], target, yaw, target_yaw


def score_published(flight: Flight) -> Tracked:
    """The published formulas with their faults, over the first to the last row with a setpoint."""
    time_s, position, velocity, setpoint, yaw, setpoint_yaw = _rows(flight)
    given = np.flatnonzero(np.linalg.norm(setpoint, axis=1) > SETPOINT_M)
    if len(given) < 2:
        raise InputError(flight.provenance.path, "has no setpoint away from the origin")
    k = slice(given[0], given[-1] + 1)
    errors = tracking.position_errors(position[k], setpoint[k])
    return Tracked(len(errors), {
        "rmse_m": rms(errors), "ade_m": float(errors.mean()),
        "velocity_rmse_m_s": tracking.published_velocity_rmse(time_s[k], velocity[k], setpoint[k]),
        "heading_deg": tracking.published_heading_error_deg(yaw[k], np.degrees(setpoint_yaw[k])),
        "divergence_percent": tracking.divergence_percent(errors)})


def score_tracking(case: Case) -> Tracked:
    """Tracking metrics over the streamed phase, angles in one unit, setpoint velocity without steps.

    ``rmse_lag_removed_m`` is left after the one best shift ``lag_s`` of the reference; ``contour_rmse_m`` is the
    distance to the path at any time; ``z_bias_m`` the mean height error. What needs neighbours is taken over the
    longest stretch without a break.
    """
    time_s, position, velocity, setpoint, yaw, setpoint_yaw = _rows(case.flight)
    rows = inside(case.spans, time_s)
    errors = tracking.position_errors(position[rows], setpoint[rows])
    whole = max(case.spans, key=lambda s: s.duration_s).mask(time_s)
    target_speed = tracking.setpoint_velocity(time_s[whole], setpoint[whole])
    lag_s, left_m = tracking.lag(time_s[whole], position[whole], setpoint[whole])
    stream = case.flight["motor"]
    motor = stream["m1", "m2", "m3", "m4"][inside(case.spans, stream.time_s)]
    return Tracked(len(errors), {
        "rmse_m": rms(errors), "ade_m": float(errors.mean()),
        "velocity_rmse_m_s": velocity_rmse(velocity[whole], target_speed),
        "heading_deg": tracking.heading_error_deg(yaw[rows], setpoint_yaw[rows]),
        "divergence_percent": tracking.divergence_percent(errors),
        "rmse_lag_removed_m": left_m, "lag_s": lag_s,
        "contour_rmse_m": rms(tracking.contour_errors(position[whole], setpoint[whole])),
        "worst_decile_m": tracking.worst_decile(errors),
        "z_bias_m": float(np.mean(position[rows, 2] - setpoint[rows, 2])),
        "solve_p99_ms": None,
        "saturated_percent": tracking.saturated_percent(motor)},
        float(np.median(np.linalg.norm(target_speed, axis=1))))


def tabulate(scored: Sequence[tuple[Case, Tracked]], seed: int = 0,
             sessions: Sessions | None = None) -> list[TrackingRow]:
    """A row for each protocol, reference, speed and controller. sessions: of all recordings of the run; None: of the
    scored ones alone."""
    sessions = sessions or Sessions.of(case.flight for case, _ in scored)
    groups: dict[Group, list[tuple[Case, Tracked]]] = {}
    for case, value in scored:
        groups.setdefault((case.protocol, case.reference, case.speed, case.controller), []).append((case, value))
    rows = []
    for (protocol, reference, speed, controller), members in sorted(groups.items(), key=_order):
        published = protocol == "as-published"
        dropped = [case.flight.name for case, value in members
                   if published and (value.metrics["rmse_m"] or 0.0) > DROPPED_ABOVE_M]
        kept = [(case, value) for case, value in members if case.flight.name not in dropped]
        if not kept:
            continue
        labels = sessions.labels(case.flight for case, _ in kept)
        found = summaries([value.metrics for _, value in kept], seed, labels)
        rows.append(TrackingRow(
            "real", protocol, controller, reference, speed, _speed(kept), "as flown", len(kept),
            [case.flight.name for case, _ in kept], dropped, Drawn.of(labels, found),
            {name: value.mean for name, value in found.items()}, found,
            beside("task2", "controllers", controller) if published else None))
    return rows


def _order(group: tuple[Group, Any]) -> tuple[str, str, int, int, str]:
    (protocol, reference, speed, controller), _ = group
    own = len(CONTROLLERS)  # after those of the firmware, by name
    order = CONTROLLERS.index(controller) if controller in CONTROLLERS else own
    return protocol, reference, ("slow", "medium", "fast", None).index(speed), order, controller


def _speed(members: Sequence[tuple[Case, Tracked]]) -> float | None:
    """Reference speed [m/s]: of the sheets if they say, else the median speed of the setpoints."""
    reported = [case.flight.metadata.get("reference_speed_m_s") for case, _ in members]
    found = [s for s in reported if s is not None] or [v.reference_speed_m_s for _, v in members
                                                   if v.reference_speed_m_s is not None]
    return float(np.median(found)) if found else None

"""Steady trim: the commands of the four motors that kept a hovering vehicle in balance.

The mean acceleration over a flight is zero: the thrusts carry the weight, and their moments about the centre of mass
cancel. Few flights excite more than that. Still, the trim shows a propeller that lost thrust: one motor has a higher
command, the others the same. It also shows a weight: all have higher commands, depending on its place. One flight is
one sample. Its rows show how well its mean is known; only other flights show how much a vehicle varies from day to day.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.thrust.firmware import PLUS
from nanobench_tools.auditing.faults.kinds import cutting_trim
from nanobench_tools.auditing.recording_audit import Audit
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, Span, intersect_spans, mask_of
from nanobench_tools.settings import number, setting
from nanobench_tools.units import GRAVITY_M_S2

from .reconstruct import States, states_of

IDLE = number("mismatch.trim.idle")
AFTER_START_S = number("mismatch.trim.after_start_s")
BEFORE_STOP_S = number("mismatch.trim.before_stop_s")
LEAST_S = number("mismatch.trim.least_s")
SHORTEST_S = number("mismatch.trim.shortest_s")
BLOCK_S = number("mismatch.trim.block_s")
STUCK_V = number("mismatch.trim.stuck_v")
SLOPES = setting("mismatch.trim.slopes")
HEIGHTS = (("estimator", "z"), ("mocap", "pz"))
PLACES = (("estimator", "x", "y"), ("mocap", "px", "py"))
COURSE_S = number("mismatch.trim.course_s")
FULL = number("mismatch.trim.full")
MOST_SATURATED = number("mismatch.trim.most_saturated")
TYPICAL_V = number("mismatch.trim.typical_v")
WHOLE = number("mismatch.trim.whole")
LEAST_LIFT = number("mismatch.trim.least_lift")
MOST_ALIKE = number("mismatch.trim.most_alike")


@dataclass(frozen=True)
class Trim:
    """Trim of one flight.

    ``gains`` (4,): ln of the thrust [N] that the commands of motors 1..4 would give on a vehicle of the type. This
    thrust is at rest and per g carried. ``level`` (2,) m/s^2: mean horizontal accelerometer in the frame of the
    heading, forward and left. It shows the angle between thrust and sensor. ``push`` (2,) m/s^2: horizontal force over
    mass that the tilt balances. An unknown value is nan. ``sd``: standard errors of these means, same keys.
    ``known_lift``: False without a measured battery, when only shares among the motors count. ``commands``: names of
    the commands in the source.
    """

    name: str
    gains: np.ndarray
    level: np.ndarray
    push: np.ndarray
    sd: dict[str, np.ndarray]
    known_lift: bool
    battery_V: float
    seconds: float
    height_m: float
    notes: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()
    course: tuple[tuple[float, ...], ...] = ()
    """Course of the flight, one row a second. Columns: time from take-off [s], x and y [m] (nan where unknown). Then ln
    thrust of motors 1..4 per g carried (``gains`` at rest)."""

    def to_json(self) -> dict[str, Any]:
        return {"name": self.name, "gains": self.gains.tolist(), "level": self.level.tolist(),
                "push": self.push.tolist(), "sd": {k: v.tolist() for k, v in self.sd.items()},
                "known_lift": self.known_lift, "battery_V": self.battery_V, "seconds": self.seconds,
                "height_m": self.height_m, "notes": list(self.notes), "commands": list(self.commands),
                "course": [list(row) for row in self.course]}

    @classmethod
    def from_json(cls, body: dict[str, Any]) -> Trim:
        def numbers(values: list[float | None]) -> np.ndarray:
            return np.array([np.nan if v is None else v for v in values], float)

        def number(value: float | None) -> float:
            return float("nan") if value is None else value

        return cls(body["name"], numbers(body["gains"]), numbers(body["level"]), numbers(body["push"]),
                   {k: numbers(v) for k, v in body["sd"].items()}, body["known_lift"], number(body["battery_V"]),
                   body["seconds"], number(body["height_m"]), tuple(body["notes"]), tuple(body["commands"]),
                   tuple(tuple(number(v) for v in row) for row in body["course"]))


def trim_of(flight: Flight, audit: Audit) -> Trim:
    """The trim of one recording. Raises InputError with the reason: no motors logged, never flew, too short, too much
    of it at full command."""
    place = flight.provenance.path
    if "motor" not in flight or any(f"m{i}" not in flight["motor"] for i in (1, 2, 3, 4)):
        raise InputError(place, "motor commands are not among its variables",
                         "log m1 to m4: a trim is computed from them")
    command = flight["motor"]["m1", "m2", "m3", "m4"]
    states = states_of(flight)
    runs = runs_of(flight, audit, command, states.time_s)
    seconds = sum(r.duration_s for r in runs)
    if seconds < LEAST_S:
        grounded = _knows_height(flight) and not audit.airborne
        why = "never left the ground" if grounded else f"{seconds:.1f} s of steady flight"
        raise InputError(place, why, f"{LEAST_S:g} s are needed for a trim")
    rows = mask_of(runs, states.time_s)
    saturated = float((command[rows] >= FULL).any(axis=1).mean())
    if saturated > MOST_SATURATED:
        raise InputError(place, f"a motor is at full command in {saturated:.0%} of the flight",
                         "a command that is cut off does not say what was needed")
    notes = [f"{name}: {text}" for name, text in states.sources.items()]
    voltage, why_not = _voltage(flight, states.time_s, rows)
    if voltage is None:
        notes.append(f"{why_not}: only shares among the motors count")
    thrust = _thrust(command * (TYPICAL_V if voltage is None else voltage[:, None]))
    values, sd = _at_rest(states, thrust, runs)
    return Trim(flight.name, values["gains"], values["level"], values["push"], sd, voltage is not None,
                float("nan") if voltage is None else float(voltage[rows].mean()), seconds,
                _height(flight, states.time_s, rows), tuple(notes), _columns(flight),
                _course(flight, states, thrust, runs))


def runs_of(flight: Flight, audit: Audit, command: np.ndarray, time_s: np.ndarray) -> list[Span]:
    """Runs of all motors in the air, without take-off and landing, and without faults of the commands."""
    on = command.min(axis=1) > IDLE
    steps = np.diff(np.concatenate([[0], on.astype(int), [0]]))
    starts, stops = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1) - 1
    runs = [Span(float(time_s[a]) + AFTER_START_S, float(time_s[b]) - BEFORE_STOP_S)
            for a, b in zip(starts, stops, strict=True) if time_s[b] - time_s[a] > AFTER_START_S + BEFORE_STOP_S]
    clean = audit.clean_for(["motor"], cutting_trim())
    found = intersect_spans(runs, clean)
    if _knows_height(flight):
        found = intersect_spans(found, audit.airborne)
    return [s for s in found if s.duration_s >= SHORTEST_S]


def _knows_height(flight: Flight) -> bool:
    """Whether a log contains the height; without it, only running motors show the flight."""
    return any(name in flight and z in flight[name] for name, z in HEIGHTS)


def _voltage(flight: Flight, time_s: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray | None, str]:
    """Battery voltage (n,) at the rows of the motors, or None and why."""
    if "battery" not in flight or "vbat" not in flight["battery"] or len(flight["battery"]) < 2:
        return None, "no battery voltage was logged"
    voltage = flight["battery"].interpolate("vbat", time_s)
    if np.isnan(voltage[rows]).any() or np.ptp(voltage[rows]) < STUCK_V:
        return None, f"the battery voltage is constant at {np.nanmean(voltage[rows]):.2f} V"
    return voltage, ""


def _thrust(motor_V: np.ndarray) -> np.ndarray:
    """[N] of motors at these voltages by the firmware's curve; below its lowest useful point a parabola through it."""
    low = 1.0
    curve = np.polynomial.polynomial.polyval(np.maximum(motor_V, low), PLUS.c)
    return np.asarray(np.where(motor_V < low, curve * (motor_V / low) ** 2, curve))


def _at_rest(states: States, thrust: np.ndarray, runs: list[Span]
             ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Means at zero velocity per quantity and their standard deviations, from blocks of BLOCK_S."""
    t = states.time_s
    block = np.full(len(t), -1)
    count = 0
    for run in runs:
        inside = run.mask(t)
        block[inside] = count + ((t[inside] - run.start_s) / BLOCK_S).astype(int)
        count = int(block.max()) + 1
    rows = block >= 0
    _, index = np.unique(block[rows], return_inverse=True)
    size = np.bincount(index)

    def means(values: np.ndarray) -> np.ndarray:
        return np.stack([np.bincount(index, column) / size for column in values[rows].T], axis=1)

    whole = size >= WHOLE * np.median(size)
    lift = 1.0 if states.acceleration_m_s2 is None else \
        1.0 + means(states.acceleration_m_s2)[whole][:, 2:3] / GRAVITY_M_S2
    signals = {"gains": np.log(means(thrust)[whole] / np.maximum(lift, LEAST_LIFT))}
    horizontal = None if states.acceleration_m_s2 is None else means(states.heading(states.acceleration_m_s2))[whole]
    if states.felt_m_s2 is not None and horizontal is not None:
        signals["level"] = means(states.felt_m_s2)[whole][:, :2] - horizontal
    if states.roll_rad is not None and horizontal is not None and states.yaw_rad is not None:
        tilt = np.stack([np.full(len(t), np.nan) if states.pitch_rad is None else states.pitch_rad,
                         -states.roll_rad], axis=1)
        signals["push"] = horizontal - GRAVITY_M_S2 * means(tilt)[whole]
    velocity = np.zeros((int(whole.sum()), 0)) if states.velocity_m_s is None else means(
        np.column_stack([states.heading(states.velocity_m_s), states.velocity_m_s[:, 2]]))[whole]
    values, sd = {}, {}
    for name, slope in SLOPES.items():
        k = 4 if name == "gains" else 2
        values[name], sd[name] = _intercept(signals[name], velocity, slope) if name in signals else \
            (np.full(k, np.nan), np.full(k, np.nan))
    return values, sd


def _course(flight: Flight, states: States, thrust: np.ndarray, runs: list[Span]) -> tuple[tuple[float, ...], ...]:
    """See ``Trim.course``; thrust (n, 4) N."""
    t = states.time_s
    lift = np.ones(len(t)) if states.acceleration_m_s2 is None else \
        1.0 + states.acceleration_m_s2[:, 2] / GRAVITY_M_S2
    place = np.full((len(t), 2), np.nan)
    for name, x, y in PLACES:
        if name in flight and x in flight[name] and y in flight[name]:
            place = np.stack([flight[name].interpolate(q, t) for q in (x, y)], axis=1)
            break
    course: list[tuple[float, ...]] = []
    for run in runs:
        for start in np.arange(run.start_s, run.end_s - 0.5 * COURSE_S, COURSE_S):
            rows = (t >= start) & (t < start + COURSE_S)
            if rows.any():
                gains = np.log(thrust[rows].mean(axis=0) / max(float(lift[rows].mean()), LEAST_LIFT))
                course.append((start + 0.5 * COURSE_S - runs[0].start_s, *place[rows].mean(axis=0).tolist(),
                               *gains.tolist()))
    return tuple(course)


def _intercept(signal: np.ndarray, velocity: np.ndarray, slope: float) -> tuple[np.ndarray, np.ndarray]:
    """Value at zero velocity of each column and its standard deviation; slopes have a Gaussian prior. Consecutive
    blocks are correlated: the spread of the mean is widened by their lag-one correlation."""
    design = np.column_stack([np.ones(len(signal)), velocity])
    spread = np.maximum(np.std(signal, axis=0), 1e-9)
    values, sd = np.full(signal.shape[1], np.nan), np.full(signal.shape[1], np.nan)
    for j in range(signal.shape[1]):
        y = signal[:, j]
        if np.isnan(y).any():
            continue
        prior = np.diag([0.0, *[(spread[j] / slope) ** 2] * velocity.shape[1]])
        inverse = np.linalg.pinv(design.T @ design + prior)
        beta = inverse @ design.T @ y
        left = y - design @ beta
        alike = float(np.clip(left[1:] @ left[:-1] / max(left @ left, 1e-30), 0.0, MOST_ALIKE))
        variance = left @ left / max(len(y) - design.shape[1], 1) * (1.0 + alike) / (1.0 - alike)
        values[j], sd[j] = beta[0], np.sqrt(variance * inverse[0, 0])
    return values, sd


def _columns(flight: Flight) -> tuple[str, ...]:
    """The source's names of the commands: their meaning differs before and after the battery compensation."""
    stream = flight["motor"]
    return tuple(stream.columns[stream.index(f"m{i}")] for i in (1, 2, 3, 4))


def _height(flight: Flight, time_s: np.ndarray, rows: np.ndarray) -> float:
    """Height over the start [m]: a load on a longer string never leaves the ground."""
    for name, z in HEIGHTS:
        if name in flight and z in flight[name]:
            stream = flight[name]
            return float(np.median(stream.interpolate(z, time_s[rows])) - np.median(stream[z][:20]))
    return float("nan")

"""A recording as the diagnosis sees it: measured states and inputs on one grid of 100 Hz, and which rows count."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from nanobench_tools import so3
from nanobench_tools.auditing.recording_audit import Audit
from nanobench_tools.auditing.verb_needs import FORCE, WRENCH
from nanobench_tools.errors import InputError
from nanobench_tools.flight import (
    Flight,
    Span,
    Stream,
    intersect_spans,
    make_stream,
    merge_spans,
    motors_of,
    subtract_spans,
)
from nanobench_tools.settings import number

from . import commanded

ROW_S = 0.01
BEFORE_S = number("mismatch.track.before_s")
EDGE_S = number("mismatch.track.edge_s")
PACKET_S = number("mismatch.track.packet_s")
STEADY_S = number("mismatch.track.steady_s")
MOST_SAG_V = number("mismatch.track.most_sag_v")
FULL_V = number("mismatch.track.full_v")
NO_BATTERY_V = number("mismatch.track.no_battery_v")
CONTACT_M = number("mismatch.track.contact_m")
CONTACT_S = number("mismatch.track.contact_s")
BOUNCE_M = number("mismatch.track.bounce_m")
LONGEST_GAP_S = number("mismatch.track.longest_gap_s")
MOST_FRAMES = number("mismatch.track.most_frames")
SHORTEST_S = number("mismatch.track.shortest_s")
ASKED_S = number("mismatch.track.asked_s")
MOST_ASKED_RAD_S2 = number("mismatch.track.most_asked_rad_s2")
REACH = 8.0
"""Standard deviations: a Gaussian that is cut earlier gives slow paths a fourth derivative."""
MOST_LATE = number("mismatch.track.most_late")
SMOOTHER = number("mismatch.track.smoother")


@dataclass(frozen=True)
class Track:
    """One span of one flight, n rows 10 ms apart.

    ``time_s`` (n,): of the recording. ``position_m``, ``velocity_m_s`` (n, 3): world. ``quaternion`` (n, 4): body to
    world. ``rate_rad_s`` (n, 3): body. ``force_m_s2`` (n, 3): specific force of the accelerometer, body, nan without
    one. ``motor`` (n, rotors): PWM ratio, and ``battery_V`` (n,), both in the middle of the row, which they represent.
    ``counts`` (n,): rows that are judged. ``since_s`` (n,): time since take-off. ``asked_rad_s2`` (n, 2): angular
    acceleration that following the set-points takes, about world y and -x, 0 without set-points. ``flight``: index into
    the flights of the diagnosis.

    ``commanded``: unit of the collective command, if no motors were logged (``commanded.py``). Each motor then gets an
    equal part of it; for N, ``motor`` is in N. ``gyro``: whether the rate was measured. ``turns``: whether the
    simulator includes how motors turn the vehicle.
    """

    name: str
    flight: int
    time_s: np.ndarray
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    quaternion: np.ndarray
    rate_rad_s: np.ndarray
    force_m_s2: np.ndarray
    motor: np.ndarray
    battery_V: np.ndarray
    counts: np.ndarray
    since_s: np.ndarray
    asked_rad_s2: np.ndarray
    commanded: str = ""
    gyro: bool = True
    turns: bool = True

    @property
    def forces_only(self) -> bool:
        """Whether only forces are compared, along the measured attitude."""
        return bool(self.commanded) or not self.turns

    def __len__(self) -> int:
        return len(self.time_s)


def missing(flight: Flight, with_battery: bool = True, rotors: int = 4,
            needed: Mapping[str, Sequence[str]] = WRENCH) -> list[str]:
    """Names of the ``needed`` streams that the recording lacks. Without ``with_battery`` the battery may be missing. At
    least as many motors as rotors are needed."""
    def there(name: str, quantities: Sequence[str]) -> bool:
        return name in flight and len(flight[name]) >= 10 and all(q in flight[name] for q in quantities) and (
            name != "motor" or len(motors_of(flight[name])) >= rotors)

    return [name for name, quantities in needed.items()
            if (with_battery or name != "battery") and not there(name, quantities)]


def check_motors(flight: Flight, rotors: int) -> None:
    """InputError for the recording of a vehicle with another number of rotors. A stream whose reader reports a lost
    column is not checked."""
    motors = motors_of(flight["motor"]) if "motor" in flight else ()
    lost = len(motors) < rotors and (
        not motors or any(f.kind == "missing_column" and f.stream == "motor" for f in flight.provenance.findings))
    if motors and not lost and len(motors) != rotors:
        raise InputError(flight.provenance.path, f"has {len(motors)} motors, {motors[0]} to {motors[-1]}, and the "
                         f"simulator {rotors} rotors", "give the simulator.toml of this vehicle")


def tracks_of(flight: Flight, audit: Audit, number: int, with_battery: bool = True, rotors: int = 4,
              unit: str = "") -> list[Track]:
    """Every clean airborne span of a recording. InputError when a stream of WRENCH is missing. Without ``with_battery``
    a missing battery counts as constant. ``unit``: of the collective command, if it replaces the motors."""
    needed = FORCE if unit else WRENCH
    lacks = missing(flight, with_battery, rotors, needed)
    if lacks:
        raise InputError(flight.provenance.path, f"has no {', '.join(lacks)} stream", "a diagnosis of physics needs it")
    if missing(flight, rotors=rotors, needed=needed):
        stamps = flight["command" if unit else "motor"].time_s
        flight = flight.with_streams(battery=make_stream("battery", stamps, np.full((len(stamps), 1), NO_BATTERY_V),
                                                         ("vbat",)))
    read = [name for name in needed if with_battery or name != "battery"]
    spans = intersect_spans(audit.airborne, audit.clean_for((*read, "")))
    start = min((s.start_s for s in audit.airborne), default=0.0)
    spans = subtract_spans(spans, _contacts(flight, audit.airborne))
    return [track for span in spans if span.duration_s >= SHORTEST_S
            for track in [_track(flight, span, number, start, rotors, unit)] if track.counts.any()]


def _contacts(flight: Flight, airborne: Sequence[Span]) -> list[Span]:
    """Where the ground may have pushed: around every touch, and from the last one on."""
    mocap = flight["mocap"]
    time_s, z = mocap.time_s, mocap["pz"]
    if not airborne:
        return []
    if airborne[0].start_s <= time_s[0] + ROW_S and airborne[-1].end_s >= time_s[-1] - ROW_S:
        return []  # a log without the ground: its lowest point is not the ground
    resting = z[time_s < airborne[0].start_s]
    rest = float(np.median(resting)) if len(resting) > 10 else float(z.min())
    inside = (time_s > airborne[0].start_s + CONTACT_S) & (time_s < airborne[-1].end_s + CONTACT_S)
    touch = np.flatnonzero(inside & (z < rest + CONTACT_M))
    spans = [Span(float(time_s[i]) - CONTACT_S, float(time_s[i]) + CONTACT_S) for i in touch]
    for i in touch:
        if z[i:].max() < rest + BOUNCE_M:
            spans.append(Span(float(time_s[i]) - CONTACT_S, float(time_s[-1])))
            break
    return list(merge_spans(spans))


def _track(flight: Flight, span: Span, number: int, take_off_s: float, rotors: int, unit: str) -> Track:
    mocap = flight["mocap"]
    needed = FORCE if unit else WRENCH
    first = max(span.start_s - BEFORE_S, *(flight[name].time_s[0] for name in needed))
    last = min(span.end_s, *(flight[name].time_s[-1] for name in needed))
    time_s = np.arange(first, last, ROW_S)
    stamps, keep = np.unique(mocap.time_s, return_index=True)
    near = np.searchsorted(stamps, [span.start_s, span.end_s])  # rows beyond may be faulty
    stamps, keep = stamps[slice(*near)], keep[slice(*near)]
    stamps = framed(stamps, mocap["px", "py", "pz"][keep])
    path = CubicSpline(stamps, mocap["px", "py", "pz"][keep])
    counts = (time_s >= span.start_s + EDGE_S) & (time_s <= span.end_s - EDGE_S)
    for hole in np.flatnonzero(np.diff(stamps) > LONGEST_GAP_S):
        counts &= (time_s < stamps[hole] - EDGE_S) | (time_s > stamps[hole + 1] + EDGE_S)
    near = np.searchsorted(stamps, time_s + EDGE_S) - np.searchsorted(stamps, time_s - EDGE_S)
    counts &= near > MOST_FRAMES * 2.0 * EDGE_S / np.median(np.diff(stamps))
    imu = flight.streams.get("imu")
    acc = ("acc_x", "acc_y", "acc_z")
    force = np.full((len(time_s), 3), np.nan)
    if imu is not None and all(a in imu for a in acc):
        force = _at(imu, acc, time_s)
    if unit:
        whole = _over_row(flight["command"], ("thrust",), time_s) / (rotors if unit == "N" else 1)
        motor = np.repeat(whole, rotors, axis=1)
    else:
        motor = _over_row(flight["motor"], motors_of(flight["motor"]), time_s)
    battery = steadied(_at(flight["battery"], ("vbat",), time_s + 0.5 * ROW_S)[:, 0], motor)
    seen_s = np.clip(time_s, stamps[0], stamps[-1])
    quaternion = so3.interpolate(stamps, mocap["qx", "qy", "qz", "qw"][keep], seen_s)
    gyro = imu is not None and all(g in imu for g in WRENCH["imu"])
    rate = _at(imu, WRENCH["imu"], time_s) if imu is not None and gyro else commanded.turning(quaternion, ROW_S)
    return Track(flight.name, number, time_s, path(seen_s), path(seen_s, 1), quaternion, rate, force, motor, battery,
                 counts, time_s - take_off_s, _asked(flight, time_s), unit, gyro)


def _asked(flight: Flight, time_s: np.ndarray) -> np.ndarray:
    """(n, 2) rad/s^2: the fourth derivative of the set-points' path over g (thrust leans where acceleration points)."""
    stream = flight.streams.get("setpoint")
    if stream is None or any(q not in stream for q in ("x", "y")) or len(stream) < 10:
        return np.zeros((len(time_s), 2))
    ahead = np.arange(1, int(BEFORE_S / ROW_S) + 1) * ROW_S
    grid = np.concatenate([time_s[0] - ahead[::-1], time_s, time_s[-1] + ahead])
    path = np.nan_to_num(_at(stream, ("x", "y"), grid))
    snap = gaussian_filter1d(path, ASKED_S / ROW_S, axis=0, order=4, mode="nearest",
                             truncate=REACH) / ROW_S**4
    return np.asarray(np.clip(snap[len(ahead):-len(ahead)] / 9.81, -MOST_ASKED_RAD_S2, MOST_ASKED_RAD_S2))


def steadied(battery_V: np.ndarray, motor: np.ndarray) -> np.ndarray:
    """Battery voltage (n,) V that moves with the load on the motors (n, rotors) and else slowly.

    It is logged at some 9 Hz with the noise of a converter and drawn as lines in between, while it sags with every
    command. The sag per load (sum of squared ratios) is read from the recording itself: changes of both within a
    second, as slow as packets come.
    """
    load = np.sum(motor**2, axis=1)

    def quick(x: np.ndarray) -> np.ndarray:
        near = gaussian_filter1d(x, PACKET_S / ROW_S, mode="nearest")
        return np.asarray(near - gaussian_filter1d(x, STEADY_S / ROW_S, mode="nearest"))

    cells = max(float(np.median(battery_V)) / FULL_V, 1.0)
    sag = np.clip(-(quick(battery_V) @ quick(load)) / max(quick(load) @ quick(load), 1e-12), 0.0, cells * MOST_SAG_V)
    return np.asarray(gaussian_filter1d(battery_V + sag * load, STEADY_S / ROW_S, mode="nearest") - sag * load)


def framed(stamps: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Stamps (n,) of frames that were stamped on arrival, put back on the camera's beat; as they are where that makes
    the path no smoother.

    Cameras are regular, radio packets are not: half a millisecond at 1.5 m/s is 0.8 mm, and 0.1 m/s of the path's
    slope. The judge is every other frame, predicted from its neighbours.
    """
    if len(stamps) < 50:
        return stamps
    period = float(np.median(np.diff(stamps)))
    for _ in range(2):  # the median of late and early packets is a beat that drifts by whole frames in long logs
        number = np.concatenate([[0.0], np.cumsum(np.maximum(np.round(np.diff(stamps) / period), 1.0))])
        period, start = np.polyfit(number, stamps, 1)
    late = stamps - (start + period * number)
    if np.abs(late).max() > MOST_LATE * period:
        return stamps
    beat: np.ndarray = start + period * number
    if _rough(beat, position) < SMOOTHER * _rough(stamps, position):
        return beat
    return stamps


def _rough(stamps: np.ndarray, position: np.ndarray) -> float:
    """RMS [m] of every other frame of a path (n, 3) off the cubic through the others, where none is missing."""
    step = np.median(np.diff(stamps))
    odd = np.arange(3, len(stamps) - 3, 2)
    odd = odd[stamps[odd + 3] - stamps[odd - 3] < 7.0 * step]
    if len(odd) < 20:
        return 0.0
    path = CubicSpline(stamps[::2], position[::2])
    return float(np.sqrt(np.mean((position[odd] - path(stamps[odd])) ** 2)))


def _over_row(stream: Stream, names: Sequence[str], time_s: np.ndarray) -> np.ndarray:
    """(n, k) value that acts over each row: the mean of several samples in the row, otherwise the value at its
    middle."""
    last = np.concatenate((np.diff(stream.time_s) > 0.0, [True]))
    stamps, values = stream.time_s[last], stream[names][last]
    if len(stamps) < 2 or np.median(np.diff(stamps)) > 0.5 * ROW_S:
        return _at(stream, names, time_s + 0.5 * ROW_S)
    steps = np.diff(stamps)[:, None]  # held from one sample to the next
    area = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values[:-1] * steps, axis=0)])
    edges = np.stack([np.interp(np.append(time_s, time_s[-1] + ROW_S), stamps, column) for column in area.T], axis=1)
    inside = np.clip(np.minimum(time_s + ROW_S, stamps[-1]) - np.maximum(time_s, stamps[0]), 1e-6, None)
    return np.asarray(np.diff(edges, axis=0) / inside[:, None])


def _at(stream: Stream, names: Sequence[str], time_s: np.ndarray) -> np.ndarray:
    last = np.concatenate((np.diff(stream.time_s) > 0.0, [True]))
    return np.stack([np.interp(time_s, stream.time_s[last], stream[name][last]) for name in names], axis=1)


def joined(tracks: Iterable[Track], field: str) -> np.ndarray:
    """One field of all tracks, end to end."""
    return np.concatenate([getattr(track, field) for track in tracks])

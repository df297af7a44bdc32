"""Data first: find, report and exclude faults of the recordings before physics is judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from nanobench_tools.auditing.faults.kinds import those
from nanobench_tools.auditing.recording_audit import Audit
from nanobench_tools.auditing.selection import distinct
from nanobench_tools.auditing.verb_needs import FORCE, WRENCH
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Fault, Flight
from nanobench_tools.physics import Vehicle
from nanobench_tools.settings import setting

from . import commanded
from .measured_speed import SPEED, seen_by
from .size import wider
from .taking_part import cutting, still_late, taking_part
from .track import ROW_S, Track, check_motors, missing, tracks_of
from .tracked_point import Arm, arm_of, centred

LEAST_S = setting("mismatch.recordings.least_s")
LATE_S = setting("mismatch.recordings.late_s")


@dataclass(frozen=True)
class Recordings:
    """Recordings prepared for a diagnosis.

    ``flights``: on the motion capture's clock where it is known. ``audits``: by name, on the same clock. ``tracks``:
    the rows that can be judged. ``faults``: (flight, fault) of all. ``left_out``: {flight: why}. ``arm``: offset of the
    tracked point from the centre of mass, where the tracks were corrected for it. Of the faults (``taking_part``),
    those in ``cut`` removed rows of the comparison. ``late``: time errors in rows that are still judged, because too
    few rows remain without them.
    """

    flights: tuple[Flight, ...]
    audits: Mapping[str, Audit]
    tracks: tuple[Track, ...]
    faults: tuple[tuple[str, Fault], ...]
    left_out: Mapping[str, str]
    arm: Arm | None = None
    cut: tuple[tuple[str, Fault], ...] = ()
    late: tuple[tuple[str, Fault], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f.name for f in self.flights)

    @property
    def touching(self) -> tuple[tuple[str, Fault], ...]:
        """Faults that reach the comparison, whether they forbid it or not."""
        return (*self.cut, *self.late)

    @property
    def forbidding(self) -> tuple[tuple[str, Fault], ...]:
        """Faults that forbid an answer.

        These are the faults in the judged rows. If too few rows remain, they include the faults that removed the
        others, provided that the flights were long enough without these faults.
        """
        flown_s = sum(s.duration_s for n in {name for name, _ in self.cut} for s in self.audits[n].airborne)
        unknown = any(not self.audits[name].airborne for name, _ in self.cut)
        lost = self.judged_s < LEAST_S and (unknown or self.judged_s + flown_s >= LEAST_S)
        return (*(self.cut if lost else ()), *self.late)

    @property
    def judged_s(self) -> float:
        """Seconds of flight that are judged."""
        return _judged_s(self.tracks)


def look_over(flights: Sequence[Flight], audits: Mapping[str, Audit],
              on_clock: Sequence[Flight], on_clock_audits: Mapping[str, Audit],
              with_battery: bool = True, vehicle: Vehicle | None = None) -> Recordings:
    """Flights as recorded with their audits, and the same on the motion capture's clock (``harness.clocks``).

    with_battery: the simulator needs the battery's voltage. vehicle: the simulator's, by default a quadrotor of 40 g.
    Raises InputError for recordings of a vehicle with another number of rotors.
    """
    vehicle = vehicle or Vehicle()
    kept = distinct(list(flights))[0]
    unit = "" if vehicle.input == SPEED else _commanded(kept)
    needed = FORCE if unit else WRENCH
    with_battery = with_battery and unit != "N"
    moved, seen = seen_by([commanded.with_attitude(f) if unit else f for f in on_clock], on_clock_audits, vehicle.input)
    left_out = {f.name: "the same numbers as another recording" for f in flights if f not in kept}
    tracks: list[Track] = []
    cut: list[tuple[str, Fault]] = []
    late: dict[str, tuple[Fault, ...]] = {}
    for number, flight in enumerate(kept):
        audit = taking_part(seen.get(flight.name, audits[flight.name]), flight, needed)
        flight = _finite(moved.get(flight.name, flight), needed)
        check_motors(flight, vehicle.rotors)
        lacks = missing(flight, with_battery, vehicle.rotors, needed)
        found = [] if lacks else tracks_of(flight, audit, number, with_battery, vehicle.rotors, unit)
        still = [t for t in found if not np.ptp(t.motor[t.counts], axis=0).any()]
        found = [t for t in found if all(t is not s for s in still)]
        cut += [(flight.name, f) for f in cutting(audit)] if not lacks else []
        if found and (left := still_late(audit, flight, LATE_S)):
            late[flight.name] = left
        if not found:
            lacks = [SPEED if name == "motor" and vehicle.input == SPEED else name for name in lacks]
            left_out[flight.name] = (f"no {', '.join(lacks)} stream" if lacks else
                                     "its motor commands never change in the air" if still else
                                     "no second in the air without a fault in its data")
        tracks += found
    in_time = [t for t in tracks if t.name not in late]
    if _judged_s(in_time) >= LEAST_S:  # enough remains without those of a clock that cannot be corrected
        left_out |= dict.fromkeys(late, "its clock is wrong and could not be put right")
        cut += [(name, f) for name, faults in late.items() for f in faults]
        tracks, late = in_time, {}
    elsewhere = those(lambda kind: not kind.in_diagnosis)
    faults = tuple((f.name, fault) for f in kept for fault in audits[f.name].faults if fault.kind not in elsewhere)
    if unit and not tracks and (blind := [f for f in kept if "mocap" in missing(moved[f.name], needed=needed)]):
        raise InputError(blind[0].provenance.path, "has a collective command, and no attitude with its position",
                         "translation needs one: mocap qx qy qz qw, or a stream attitude_qw or attitude")
    arm = arm_of(tracks, wider(vehicle)) if all(t.gyro for t in tracks) else None
    if arm is not None and arm.counts:
        tracks = list(centred(tracks, arm.r_m))
    else:
        arm = None
    return Recordings(tuple(moved.get(f.name, f) for f in kept), dict(on_clock_audits), tuple(tracks), faults, left_out,
                      arm, tuple(cut), tuple((name, f) for name, left in late.items() for f in left))


def _judged_s(tracks: Sequence[Track]) -> float:
    return ROW_S * sum(int(t.counts.sum()) for t in tracks)


def _commanded(flights: Sequence[Flight]) -> str:
    """Unit of the collective command, where no flight has motors. InputError where flights disagree."""
    found = dict.fromkeys(commanded.unit_of(f) for f in flights if "motor" in f or "command" in f)
    if len(found) > 1 and "" not in found:
        other = next(f for f in flights if commanded.unit_of(f) == list(found)[1])
        raise InputError(other.provenance.path, "its collective command is in another unit than that of the others",
                         "diagnose recordings in N and in shares of full apart")
    return next(iter(found), "") if "" not in found else ""


def _finite(flight: Flight, needed: Mapping[str, Sequence[str]]) -> Flight:
    """Drop rows of required streams without a number. The audit excludes them from judgement, but smoothing and warm-up
    would still use them as neighbours."""
    mended = {}
    for name, quantities in needed.items():
        if name in flight and all(q in flight[name] for q in quantities):
            stream = flight[name]
            fine = np.isfinite(stream[quantities]).all(axis=1) & np.isfinite(stream.time_s)
            if not fine.all():
                mended[name] = replace(stream, time_s=stream.time_s[fine], values=stream.values[fine],
                                       time_sd_s=None if stream.time_sd_s is None else stream.time_sd_s[fine])
    return flight.with_streams(**mended) if mended else flight

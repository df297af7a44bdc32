"""What a cloned policy is shown: observations and motor commands of logged flights, whole flights held out.

Observation of 14 (published): position m, estimated velocity m/s, estimated quaternion x y z w, position setpoint m,
battery V; action: four PWM ratios. Published as "supervised on the logged onboard PID" are all flights, including
those of the Mellinger controller. One of them is the flight that the published row was flown against. Here policies
learn from PID flights alone.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from nanobench_tools import so3
from nanobench_tools.auditing.recording_audit import Audit
from nanobench_tools.auditing.selection import distinct
from nanobench_tools.auditing.usable import MOCAP, MOTORS, usable
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, Span, intersect_spans
from nanobench_tools.metrics.association import associate
from nanobench_tools.protocols.phases import MOTOR_ON
from nanobench_tools.protocols.task2 import PUBLISHED
from nanobench_tools.protocols.windows import rows_at_100_hz
from nanobench_tools.settings import count, number
from nanobench_tools.sources.labels import family_of, speed_of

OBSERVED, STATE = 14, 10
"""Of an observation the first ten are the vehicle's, setpoint and battery come from outside."""
NEEDED = {"mocap": MOCAP, "estimator": ("vx", "vy", "vz"), "attitude_qw": ("qx", "qy", "qz", "qw"),
          "setpoint": ("x", "y", "z"), "motor": MOTORS, "battery": ("vbat",)}
SHORTEST = count("control.demonstrations.shortest")
TEACHER = "pid"
HELD_OUT = number("control.demonstrations.held_out")


@dataclass(frozen=True)
class Demonstration:
    """One flight with motors on and good logs: observed (m, 14), action (m, 4) every 10 ms, lengths of its stretches;
    ``path`` (m, 6): position and velocity of the motion capture."""

    name: str
    controller: str
    reference: str
    observed: np.ndarray
    action: np.ndarray
    path: np.ndarray
    lengths: tuple[int, ...]

    @property
    def longest(self) -> slice:
        """Rows of the longest stretch without a break."""
        ends = np.cumsum(self.lengths)
        k = int(np.argmax(self.lengths))
        return slice(int(ends[k] - self.lengths[k]), int(ends[k]))


@dataclass(frozen=True)
class Shown:
    """Whole flights: train and valid by the teacher, test also by others; the published reference is always test."""

    train: list[Demonstration]
    valid: list[Demonstration]
    test: list[Demonstration]

    @property
    def sha256(self) -> str:
        """Hash of all that trains and validates."""
        digest = hashlib.sha256()
        for d in (*self.train, *self.valid):
            for values in (d.observed, d.action):
                digest.update(np.ascontiguousarray(values).tobytes())
        return digest.hexdigest()


def demonstrations(flights: Sequence[Flight], audits: Mapping[str, Audit]) -> list[Demonstration]:
    """Every usable recording once, earliest first."""
    found = []
    for flight in sorted(usable(distinct(flights)[0], audits, NEEDED), key=lambda f: f.epoch_s):
        audit = audits[flight.name]
        stream = flight["motor"]
        on = np.flatnonzero((stream["m1"] > MOTOR_ON) & (stream["m1"] <= 1.0))
        if not len(on) or audit.controller in ("none", "unknown"):
            continue
        flown = [Span(float(stream.time_s[on[0]]), float(stream.time_s[on[-1]]))]
        time_s, lengths = rows_at_100_hz(flight, intersect_spans(flown, audit.clean_for(list(NEEDED))))
        if len(time_s) and max(lengths) >= SHORTEST:
            found.append(_demonstration(flight, audit.controller, time_s, lengths))
    return found


def _demonstration(flight: Flight, controller: str, time_s: np.ndarray, lengths: Sequence[int]) -> Demonstration:
    mocap = flight["mocap"]
    at = associate(time_s, mocap.time_s, mocap["px", "py", "pz"], mocap["qx", "qy", "qz", "qw"],
                   mocap["vx", "vy", "vz"])
    turned = flight["attitude_qw"]
    quaternion = so3.interpolate(turned.time_s, turned["qx", "qy", "qz", "qw"], time_s)
    observed = np.concatenate([
        at.position_m, flight["estimator"].interpolate(("vx", "vy", "vz"), time_s), upright(quaternion),
        flight["setpoint"].interpolate(("x", "y", "z"), time_s),
        flight["battery"].interpolate("vbat", time_s)[:, None]], axis=1)
    action = np.clip(flight["motor"].interpolate(MOTORS, time_s), 0.0, 1.0)
    reference = f"{family_of(flight)} {speed_of(flight)}"
    return Demonstration(flight.name, controller, reference, observed.astype(np.float32), action.astype(np.float32),
                         np.concatenate([at.position_m, np.asarray(at.velocity_m_s)], axis=1), tuple(lengths))


def upright(quaternion: np.ndarray) -> np.ndarray:
    """The sign with w >= 0: q and -q are the same attitude, a network has to see one of them."""
    return np.where(quaternion[..., 3:] < 0.0, -quaternion, quaternion)


def shown(found: Sequence[Demonstration], seed: int = 0) -> Shown:
    """Whole flights to learn from, to validate on and to test on; drawn with ``seed`` from the flights in order of
    their content. Raises InputError when no flight of the teacher is left to learn from or none to test on."""
    published = [d for d in found if d.reference == " ".join(PUBLISHED)]
    rest = sorted((d for d in found if d.controller == TEACHER and d.reference != " ".join(PUBLISHED)),
                  key=lambda d: hashlib.sha256(d.action.tobytes()).hexdigest())
    if len(rest) < 3:
        raise InputError("training flights", f"{len(rest)} flights of the onboard PID to learn from",
                         "three or more are needed: one each trains, validates, tests")
    order = np.random.default_rng(seed).permutation(len(rest))
    each = max(1, round(HELD_OUT * len(rest)))
    test, valid, train = ([rest[i] for i in part] for part in (order[:each], order[each:2 * each], order[2 * each:]))
    return Shown(train, valid, [*published, *test])

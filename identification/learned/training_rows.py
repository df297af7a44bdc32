"""Rows of flights as the networks learn from them: states and inputs every 10 ms, and where windows may start."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.metrics.association import associate
from nanobench_tools.protocols.task1 import Case
from nanobench_tools.protocols.windows import HORIZON, TRUTHS, rows_at_100_hz

STATES, MOTORS = 12, 4
TRAIN_SHARE = 0.8
"""Of every flight, in time; the rest validates."""
EVERY = 10
"""Validation windows start so many rows apart, as those that are scored."""


@dataclass(frozen=True)
class Rows:
    """All rows of some flights end to end.

    - state (m, 12): position m, velocity m/s (world), rotation vector rad, body rate rad/s.
    - inputs (m, 5): PWM ratios and battery V.
    - train, valid: rows at which a window of HORIZON steps starts that lies in one stretch and on one side of the cut.
    - flight (m,): number of the flight; names: of the flights."""

    state: np.ndarray
    inputs: np.ndarray
    train: np.ndarray
    valid: np.ndarray
    flight: np.ndarray
    names: tuple[str, ...]

    @property
    def sha256(self) -> str:
        """Hash of everything in here."""
        digest = hashlib.sha256("\0".join(self.names).encode())
        for values in (self.state, self.inputs, self.train, self.valid, self.flight):
            digest.update(np.ascontiguousarray(values).tobytes())
        return digest.hexdigest()

    def scaling(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Mean and spread of states (12,) and inputs (5,) over the rows in which training windows start."""
        x, u = self.state[self.train], self.inputs[self.train]
        return x.mean(0), np.maximum(x.std(0), 1e-3), u.mean(0), np.maximum(u.std(0), 1e-3)


def rows_of(cases: Sequence[Case], truth: str = "onboard", train_share: float = TRAIN_SHARE) -> Rows:
    """The rows of all flights. Of every flight the first ``train_share`` of its rows train, the rest validates, and no
    window lies across the cut. Attitude from the stream of ``truth``.

    Raises InputError when no training or no validation window is left.
    """
    parts = [part for case in cases if (part := _flight(case, truth)) is not None]
    states, inputs, train, valid, flight = [], [], [], [], []
    at = 0
    for number, (state, given, lengths) in enumerate(parts):
        cut = round(train_share * len(state))
        first = 0
        for length in lengths:
            middle = min(max(cut, first), first + length)
            train.append(at + np.arange(first, max(middle - HORIZON, first)))
            valid.append(at + np.arange(middle, max(first + length - HORIZON, middle), EVERY))
            first += length
        states.append(state)
        inputs.append(given)
        flight.append(np.full(len(state), number))
        at += len(state)
    places = "training flights"
    if not parts or not sum(map(len, train)):
        raise InputError(places, f"no window of {HORIZON} rows to train on is left in {len(cases)} flights",
                         "nanobench audit says what each recording lacks")
    if train_share < 1.0 and not sum(map(len, valid)):
        raise InputError(places, f"no window of {HORIZON} rows is left to validate on in {len(cases)} flights",
                         "give longer or more flights")
    return Rows(np.concatenate(states).astype(np.float32), np.concatenate(inputs).astype(np.float32),
                np.concatenate(train).astype(np.int32), np.concatenate(valid).astype(np.int32),
                np.concatenate(flight), tuple(case.flight.name for case in cases))


def _flight(case: Case, truth: str) -> tuple[np.ndarray, np.ndarray, list[int]] | None:
    """(states, inputs, lengths of its stretches) of one flight."""
    time_s, lengths = rows_at_100_hz(case.flight, case.spans)
    if not len(time_s):
        return None
    flight, mocap = case.flight, case.flight["mocap"]
    found = associate(time_s, mocap.time_s, mocap["px", "py", "pz"], mocap["qx", "qy", "qz", "qw"],
                      mocap["vx", "vy", "vz"])
    stream = flight[TRUTHS[truth]]
    turned = so3.interpolate(stream.time_s, stream["qx", "qy", "qz", "qw"], time_s)
    state = np.concatenate([found.position_m, np.asarray(found.velocity_m_s), unwrapped(so3.log(turned), lengths),
                            flight["imu"].interpolate(("gyro_x", "gyro_y", "gyro_z"), time_s)], axis=1)
    motor = flight["motor"].interpolate(("m1", "m2", "m3", "m4"), time_s)
    return state, np.concatenate([motor, flight["battery"].interpolate("vbat", time_s)[:, None]], axis=1), lengths


def unwrapped(vector: np.ndarray, lengths: Sequence[int]) -> np.ndarray:
    """Rotation vectors (m, 3) that do not jump within a stretch: r and r - 2 pi r/|r| are the same rotation.

    >>> unwrapped(np.array([[0.0, 0.0, 3.1], [0.0, 0.0, -3.1]]), [2])[1].round(3).tolist()
    [0.0, 0.0, 3.183]
    """
    out, first = np.array(vector, float), 0
    for length in lengths:
        part = out[first:first + length]
        for i in np.flatnonzero(np.linalg.norm(np.diff(part, axis=0), axis=1) > np.pi) + 1:
            angle = np.linalg.norm(part[i:], axis=1, keepdims=True)
            part[i:] = part[i:] * (1.0 - 2.0 * np.pi / np.maximum(angle, 1e-9))
        first += length
    return out

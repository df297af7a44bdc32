"""Dead reckoning with a learned velocity, from IMU and motors of the last second.

A ridge regression from sums of the past that fade at several rates to the body's velocity across the rotors' axis.
Three signals depend on that velocity: drag (accelerometer), the moment on rotors in a side wind (gyro) and the
controller's reaction (motor voltages). Products make the regression nonlinear. The filter uses it in addition to drag,
with an SD that grows with the velocity. The regression has a weight for a constant error of the accelerometer, so that
the bias stays a state. A network would have a hundred times as many parameters for the same flights; here every one
can be read.

Weights are in ``learned_velocity.json``, one set for each trajectory type, fitted without that type (``python
benchmarks/studies/learned_velocity.py``). So a flight is never judged by weights that saw its type.
"""

import functools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numba as nb
import numpy as np

from nanobench_tools.flight import Flight
from nanobench_tools.settings import number, setting
from nanobench_tools.sources.labels import family_of
from nanobench_tools.units import GRAVITY_M_S2

from .drag_ekf import TUNED
from .inertial import ACC, GYRO, MOTORS, Inertial, Rows, held

FILE = Path(__file__).with_suffix(".json")
EVERY = "every"
"""The set that all types had a part in, for flights of a type that none was left out for."""

FADES_S = setting("imu.learned_velocity.fades_s")
HOVER_V = number("imu.learned_velocity.hover_v")

RIDGE = number("imu.learned_velocity.ridge")

SD_FACTOR = number("imu.learned_velocity.sd_factor")
OWN = setting("imu.learned_velocity.own")


@dataclass(frozen=True)
class Weights:
    """Body velocity [m/s] across the rotors: of x and y by the features (2, F); variance floor + slope x velocity^2."""

    by: np.ndarray
    floor: float
    slope: float

    def measured(self, features: np.ndarray) -> np.ndarray:
        """As ``inertial_core.run`` takes it (n, 6), from features (n, 2, F)."""
        velocity = np.einsum("nkf,kf->nk", features, self.by)
        sd = SD_FACTOR * np.sqrt(self.floor + self.slope * velocity**2)
        return np.column_stack([velocity, sd, np.tile(self.by[:, : len(FADES_S)].sum(axis=1), (len(features), 1))])

    def to_json(self) -> dict[str, Any]:
        return {"by": [[float(f"{w:.5g}") for w in row] for row in self.by], "floor": float(f"{self.floor:.4g}"),
                "slope": float(f"{self.slope:.4g}")}


class LearnedVelocityEkf(Inertial):
    """``drag_matrix_ekf`` with a velocity learned from IMU and motors in addition to drag.

    It needs the streams ``motor`` and ``battery``.
    """

    name = "learned_velocity_ekf"
    settings: ClassVar = {**TUNED, **OWN}
    needs = ("motor", "battery")
    trained_on = ("velocity learned from the public flights of all trajectory types but the flight's own (of all "
                  "where the recording does not say its type)")

    def measured(self, flight: Flight, rows: Rows) -> np.ndarray:
        time_s, found = features(flight)
        weights = shipped()
        return weights.get(family_of(flight), weights[EVERY]).measured(found[np.searchsorted(time_s, rows.time_s)])


def features(flight: Flight) -> tuple[np.ndarray, np.ndarray]:
    """Stamps (n,) of the IMU's rows that hold numbers, and (n, 2, F): what x and y are regressed on. Causal."""
    imu = flight["imu"]
    good = np.isfinite(imu[ACC + GYRO]).all(axis=1) & np.isfinite(imu.time_s)
    time_s, acc, gyro = imu.time_s[good], imu[ACC][good], imu[GYRO][good]
    volt = held(flight["motor"], MOTORS, time_s) * held(flight["battery"], ("vbat",), time_s)
    total = volt.sum(axis=1) / HOVER_V - 1.0
    front, left = volt @ [1.0, -1.0, -1.0, 1.0], volt @ [-1.0, -1.0, 1.0, 1.0]
    faded = _faded(time_s, np.column_stack([acc, gyro, front, left, total]), np.array(FADES_S))
    axes = []
    for k, motors in ((0, 6), (1, 7)):
        a = faded[:, 1, k]
        bent = np.column_stack([a * np.abs(a), a * faded[:, 1, 8], a * (faded[:, 1, 2] / GRAVITY_M_S2 - 1.0),
                                a * faded[:, 2, 5]])
        axes.append(np.column_stack([faded[:, :, k], faded[:, 1:, 4 - k], faded[:, 1:, motors], bent]))
    return time_s, np.stack(axes, axis=1)


def fitted(flights: Sequence[tuple[np.ndarray, np.ndarray]]) -> Weights:
    """From features (n, 2, F) and true body velocity x, y (n, 2) [m/s] of every flight. Per-flight constants (biases
    and trims) are removed."""
    x = np.concatenate([found - found.mean(axis=0) for found, _ in flights])
    y = np.concatenate([true - true.mean(axis=0) for _, true in flights])
    by = np.empty(x.shape[1:])
    for k in range(2):
        moments = x[:, k].T @ x[:, k]
        by[k] = np.linalg.solve(moments + RIDGE * np.diag(np.diag(moments)), x[:, k].T @ y[:, k])
    predicted = np.einsum("nkf,kf->nk", x, by)
    slope, floor = np.polyfit(predicted.ravel() ** 2, (predicted - y).ravel() ** 2, 1)
    return Weights(by, max(float(floor), 1e-6), max(float(slope), 0.0))


@functools.cache
def shipped() -> Mapping[str, Weights]:
    """Trajectory type that was left out -> weights."""
    sets = json.loads(FILE.read_text("utf-8"))["left_out"]
    return {name: Weights(np.array(one["by"]), one["floor"], one["slope"]) for name, one in sets.items()}


@nb.njit(cache=True)
def _faded(time_s: np.ndarray, values: np.ndarray, fades_s: np.ndarray) -> np.ndarray:
    """(n, k, d): means of the rows of ``values`` (n, d) so far, forgotten with ``fades_s`` (k,)."""
    n, d = values.shape
    found = np.empty((n, len(fades_s), d))
    for j in range(len(fades_s)):
        for c in range(d):
            mean = values[0, c]
            for i in range(n):
                if i > 0:
                    gone = min(max(time_s[i] - time_s[i - 1], 0.0), 1.0)
                    mean += (1.0 - np.exp(-gone / fades_s[j])) * (values[i, c] - mean)
                found[i, j, c] = mean
    return found

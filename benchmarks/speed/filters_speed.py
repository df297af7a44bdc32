"""Speed of the inertial filters, as multiples of real time on one core, against plain NumPy and GTSAM's filter.

    python benchmarks/speed/filters_speed.py [--seconds 40]

A practice flight with a pose every 10 ms for the first half, none afterwards.

"plain NumPy" does the arithmetic of the compiled core row by row. It has 23 states: propagation by dense matrices, the
six scalars of a pose, two of drag; GTSAM's NavStateImuEKF (9 states, no biases, no drag) is called from Python row by
row, with positions as measurements. The median of five runs; compilation is not counted. All in processor time of one
process.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from kept import show

from estimators.drag_ekf import DragMatrixEkf
from estimators.error_state_ekf import ErrorStateEkf
from estimators.inertial import Rows, rows_of, run, values_of
from estimators.inertial_core import ERROR
from estimators.invariant_ekf import InvariantEkf
from nanobench_tools import so3
from nanobench_tools.flight import Flight, Span
from nanobench_tools.practice import practice_flight
from nanobench_tools.protocols.blackout import given_until

SLOW_ROWS = 500
"""The uncompiled filters run over so many rows only, with a pose each."""


def seconds_of(function: Callable[[], object], times: int = 5) -> float:
    """Median processor time of a call, after one that is not counted."""
    function()
    taken = []
    for _ in range(times):
        before = time.process_time()
        function()
        taken.append(time.process_time() - before)
    return float(np.median(taken))


def skew(v: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def plain_numpy(rows: Rows) -> np.ndarray:
    """Position (n, 3) by the same filter with linear drag, one row after the other."""
    p, q, v = rows.poses[0, :3].copy(), rows.poses[0, 3:].copy(), np.zeros(3)
    rest = np.zeros(ERROR)
    cov = 1e-2 * np.eye(ERROR)
    noise = np.diag(np.concatenate([np.zeros(3), np.full(3, 9e-4), np.full(3, 9e-4), np.full(ERROR - 9, 1e-6)]))
    out = np.empty((len(rows.time_s), 3))
    for i in range(len(out)):
        if i:
            dt = rows.time_s[i] - rows.time_s[i - 1]
            force, rate = rows.acc[i] - rest[9:12], rows.gyro[i] - rest[12:15]
            rot = so3.matrix(q)
            a = rot @ force - [0.0, 0.0, 9.81]
            p, v = p + dt * v + 0.5 * dt * dt * a, v + dt * a
            q = so3.multiply(q, so3.exp(rate * dt))
            f = np.eye(ERROR)
            f[0:3, 3:6] = dt * np.eye(3)
            f[3:6, 6:9], f[3:6, 9:12] = -rot @ skew(force) * dt, -rot * dt
            f[6:9, 6:9] -= skew(rate) * dt
            f[6:9, 12:15] = -dt * np.eye(3)
            cov = f @ cov @ f.T + noise * dt
        rot = so3.matrix(q)
        measured = []
        for j in range(rows.arrived[i], rows.arrived[i + 1]):
            off = so3.log(so3.multiply(so3.conjugate(q), rows.poses[j, 3:]))
            for k in range(3):
                h = np.zeros(ERROR)
                h[k] = 1.0
                measured.append((h, rows.poses[j, k] - p[k], 1e-4))
                h = np.zeros(ERROR)
                h[6 + k] = h[15 + k] = 1.0
                measured.append((h, off[k] - rest[15 + k], 1e-2))
        body = rot.T @ v
        for k in range(2):
            h = np.zeros(ERROR)
            h[3:6], h[9 + k] = -0.4 * rot[:, k], 1.0
            measured.append((h, rows.acc[i, k] - rest[9 + k] + 0.4 * body[k], 0.36))
        x = np.zeros(ERROR)
        for h, innovation, variance in measured:
            ph = cov @ h
            gain = ph / (h @ ph + variance)
            x = x + gain * (innovation - h @ x)
            left = np.eye(ERROR) - np.outer(gain, h)
            cov = left @ cov @ left.T + variance * np.outer(gain, gain)
        p, v, q = p + x[0:3], v + x[3:6], so3.multiply(q, so3.exp(x[6:9]))
        rest[9:] += x[9:]
        out[i] = p
    return out


def gtsam_filter(rows: Rows) -> np.ndarray | None:
    """Position (n, 3) by GTSAM's own filter; None where it is not installed."""
    try:
        import gtsam
    except ImportError:
        return None
    params = gtsam.PreintegrationParams.MakeSharedU(9.81)
    params.setAccelerometerCovariance(9e-4 * np.eye(3))
    params.setGyroscopeCovariance(9e-4 * np.eye(3))
    params.setIntegrationCovariance(1e-8 * np.eye(3))
    x, y, z, w = rows.poses[0, 3:]
    start = gtsam.NavState(gtsam.Pose3(gtsam.Rot3.Quaternion(w, x, y, z), rows.poses[0, :3]), np.zeros(3))
    ekf = gtsam.NavStateImuEKF(start, 1e-2 * np.eye(9), params)
    out = np.empty((len(rows.time_s), 3))
    for i in range(len(out)):
        if i:
            ekf.predict(rows.gyro[i], rows.acc[i], rows.time_s[i] - rows.time_s[i - 1])
        for j in range(rows.arrived[i], rows.arrived[i + 1]):
            now = ekf.state()
            h = np.zeros((3, 9))
            h[:, 3:6] = now.attitude().matrix()
            ekf.updateWithVector(now.position(), h, rows.poses[j, :3], 1e-4 * np.eye(3))
        out[i] = ekf.state().position()
    return out


def first_rows(rows: Rows, n: int) -> Rows:
    """The first n rows alone: for what takes long."""
    cut = {name: getattr(rows, name)[:n] for name in ("time_s", "clock_s", "acc", "gyro", "drawn", "flying")}
    return replace(rows, **cut, arrived=rows.arrived[:n + 1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=40.0)
    flight: Flight = practice_flight(seed=1)
    flight = flight.during(Span(-np.inf, flight["imu"].time_s[0] + parser.parse_args().seconds))
    length = flight["imu"].span.duration_s
    flight = given_until(flight, flight["imu"].time_s[0] + 0.5 * length)
    rows = rows_of(flight)
    n = len(rows.time_s)

    def say(label: str, taken_s: float, more: str = "") -> None:
        print(f"  {label:48s} {length / taken_s:9.0f} x {1e6 * taken_s / n:9.1f} us a row  {more}", flush=True)

    print(f"one SYNTHETIC flight of {length:.1f} s, {n} rows; multiples of real time, one core")
    core = seconds_of(partial(run, rows, values_of(DragMatrixEkf.settings), False))
    say("compiled core, 23 states", core)
    for method in (ErrorStateEkf(), DragMatrixEkf(), InvariantEkf()):
        say(method.name + " with reading and checks", seconds_of(partial(method.estimate, flight)))
    half = first_rows(rows, SLOW_ROWS)
    for label, function in (("plain NumPy, the same states", plain_numpy),
                            ("GTSAM NavStateImuEKF, 9 states, from Python", gtsam_filter)):
        if function(first_rows(rows, 3)) is not None:
            taken = seconds_of(partial(function, half), 1) * n / len(half.time_s)
            say(label, taken, f"the core is {taken / core:.1f} times as fast")
            show(f"{label} / compiled core", taken / core, len(half.time_s))


if __name__ == "__main__":
    main()

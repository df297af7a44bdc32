"""Flights made of formulas, so that every score is known beforehand."""

import hashlib
from dataclasses import replace

import numpy as np

from nanobench_tools import so3
from nanobench_tools.auditing.recording_audit import Audit
from nanobench_tools.flight import STREAM_QUANTITIES, Fault, Flight, Provenance, Span, make_stream

LIFT_S, PATH_S, LAND_S, END_S = 2.0, 5.0, 21.0, 25.0


def circle(t: np.ndarray) -> np.ndarray:
    """(n, 3) m: ground, climb to 1 m, hover, a circle of 1 m at 0.5 m/s, down again."""
    height = np.clip((t - LIFT_S) / 2.0, 0.0, 1.0) * np.clip((END_S - 2.0 - t) / 2.0, 0.0, 1.0)
    angle = 0.5 * np.clip(t - PATH_S, 0.0, LAND_S - PATH_S)
    away = np.clip((t - PATH_S) / 0.05, 0.0, 1.0)
    return np.stack([away * np.cos(angle), away * np.sin(angle), height], axis=1)


def made_flight(name: str = "made", late_s: float = 0.02, lag_s: float = 0.5, seed: int = 0, epoch_s: float = 1e9,
                family: str | None = "circle", speed: str | None = "slow", trajectory_id: str | None = None) -> Flight:
    """A recording at 100 Hz in which the estimate is ``late_s`` behind the truth, and the truth ``lag_s`` behind the
    setpoint; attitude turns slowly about z."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, END_S, 0.01)
    truth = circle(t - lag_s) + 1e-5 * rng.normal(size=(len(t), 3))
    velocity = np.gradient(circle(t - lag_s), t, axis=0)
    yaw = 0.02 * t
    q = so3.from_euler_zyx(0.05 * np.sin(t), 0.05 * np.cos(t), yaw)
    flown = (t > LIFT_S) & (t < END_S - 1.5)
    motor = np.where(flown[:, None], 0.8 + 0.01 * rng.normal(size=(len(t), 4)), 0.0)
    euler = so3.euler_zyx(q)
    zero = np.zeros(len(t))
    gyro = np.gradient(euler, t, axis=0)
    made = {
        "mocap": (np.column_stack([truth, q, euler, velocity, gyro]),
                  tuple(STREAM_QUANTITIES["mocap"])),
        "imu": (np.column_stack([zero, zero, zero + 9.81, gyro]),
                ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")),
        "motor": (motor, ("m1", "m2", "m3", "m4")),
        "estimator": (np.column_stack([circle(t - lag_s - late_s), velocity]), ("x", "y", "z", "vx", "vy", "vz")),
        "attitude": (euler, ("roll", "pitch", "yaw")), "attitude_qw": (q, ("qx", "qy", "qz", "qw")),
        "setpoint": (np.column_stack([circle(t), zero]), ("x", "y", "z", "yaw")),
        "battery": ((3.9 - 0.01 * t)[:, None], ("vbat",)),
    }
    streams = {key: make_stream(key, t, values, names, rate_hz=100.0) for key, (values, names) in made.items()}
    sha256 = hashlib.sha256(truth.tobytes() + repr((late_s, lag_s, epoch_s)).encode()).hexdigest()
    metadata = {"family": family, "speed": speed, "trajectory_id": trajectory_id, "reference_speed_m_s": None}
    return Flight(name, streams, metadata, Provenance(f"{name}.csv", sha256, "made"), epoch_s)


def verdict(flight: Flight, *faults: Fault, controller: str = "pid", airborne: tuple[Span, ...] | None = None) -> Audit:
    """An audit that says what the test wants."""
    spans = (Span(LIFT_S + 0.2, END_S - 2.2),) if airborne is None else airborne
    return Audit(flight.name, flight.provenance.path, flight.provenance.sha256, controller, spans, (flight.span,),
                 faults, {}, {}, flight.span)


def dead(stream: str, start_s: float, end_s: float = END_S) -> Fault:
    return Fault("dead_stream", stream, (), start_s, end_s, end_s - start_s, "s", "made up")


def cut(flight: Flight, start_s: float, end_s: float, name: str = "piece") -> Flight:
    """A slice with a clock of its own, as if it were a file of its own."""
    part = flight.during(Span(start_s, end_s))
    first = part["mocap"].time_s[0]
    streams = {key: replace(s, time_s=s.time_s - first) for key, s in part.streams.items()}
    sha256 = hashlib.sha256(f"{flight.provenance.sha256} {start_s} {end_s}".encode()).hexdigest()
    return replace(part, name=name, streams=streams, epoch_s=flight.epoch_s + first,
                   provenance=replace(flight.provenance, path=f"{name}.csv", sha256=sha256))

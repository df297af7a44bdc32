"""Faults of a whole recording: it never flew, it crashed, its estimator was reset, it is there twice."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ... import so3
from ...auditing.faults.kind import Injection
from ...flight import Fault, Flight
from ...units import GRAVITY_M_S2
from .place import choose_time, truth, with_values
from .room import POSE, _with_poses

IMPACT_S = 0.03
"""How long the blow lasts."""


def never_flew(flight: Flight, rng: np.random.Generator, size: float | None = None) -> tuple[Flight, Fault]:
    """Only what lies before the motors start is left; ``size`` is not used."""
    motor = flight["motor"]
    running = np.flatnonzero((motor.values > 0.0).any(axis=1))
    end = float(motor.time_s[running[0]] - 0.05) if len(running) else flight.span.end_s
    cut = flight.with_streams(**{name: s.rows(s.time_s < end) for name, s in flight.streams.items()})
    span = cut.span.start_s, cut.span.end_s
    return cut, truth("never_flew", "", (), span, float("nan"), "", "cut before motor start")


def copy(flight: Flight, rng: np.random.Generator, size: float | None = None) -> tuple[Flight, Fault]:
    """The same numbers under another name and another sheet; ``size`` is not used."""
    provenance = replace(flight.provenance, path=f"again/{flight.provenance.path}")
    twin = replace(flight, name=f"{flight.name}_again", provenance=provenance)
    span = flight.span.start_s, flight.span.end_s
    return twin, truth("copy", "", (), span, float("nan"), "", "same recording again")


def estimator_reset(flight: Flight, rng: np.random.Generator, size: float = 0.5, *, at_s: float | None = None,
                    recovers_s: float = 0.5) -> tuple[Flight, Fault]:
    """The estimated position jumps by ``size`` m in a random direction and finds back exponentially."""
    s = flight["estimator"]
    i = int(np.searchsorted(s.time_s, choose_time(flight, rng, at_s)))
    way = rng.standard_normal(3)
    values = s.values.copy()
    columns = [s.index(q) for q in "xyz"]
    decay = np.exp(-(s.time_s[i:] - s.time_s[i]) / recovers_s)
    values[i:, columns] += np.outer(decay, size * way / np.linalg.norm(way))
    at = float(s.time_s[i])
    return (flight.with_streams(estimator=with_values(s, values)),
            truth("estimator_reset", "estimator", [s.columns[c] for c in columns], (at, at + recovers_s), size, "m",
                  "position jumped"))


def crash(flight: Flight, rng: np.random.Generator, size: float = 1.0, *,
          at_s: float | None = None) -> tuple[Flight, Fault]:
    """Motors stop in the air: free fall, a blow, and the vehicle lies on its side to the end.

    size: speed of the blow seen by the accelerometer, as a share of the true speed over IMPACT_S; the truth's size is
    the largest tilt. Kinematics only; positions, attitude, estimate, IMU and motors follow, setpoints go to zero;
    battery and pid are left as they were.
    """
    mocap = flight["mocap"]
    start = int(np.searchsorted(mocap.time_s, choose_time(flight, rng, at_s, 5.0)))
    t0, ground = float(mocap.time_s[start]), float(mocap["pz"][0])
    p0, v0 = mocap["px", "py", "pz"][start], mocap["vx", "vy", "vz"][start]
    q0 = mocap["qx", "qy", "qz", "qw"][start]
    fall_s = (v0[2] + np.sqrt(v0[2] ** 2 + 2 * GRAVITY_M_S2 * max(p0[2] - ground, 0.0))) / GRAVITY_M_S2
    blow = (v0[2] - GRAVITY_M_S2 * fall_s) * size
    turn = np.array([*(rng.uniform(4.0, 8.0, 2) * rng.choice([-1.0, 1.0], 2)), 0.0])
    lies = so3.from_euler_zyx(np.pi / 2 + 0.1 * rng.standard_normal(), 0.0, so3.euler_zyx(q0)[2])

    def pose(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        since = np.clip(t - t0, 0.0, fall_s)[:, None]
        p = p0 + v0 * since - np.array([0.0, 0.0, 0.5 * GRAVITY_M_S2]) * since**2
        q = so3.multiply(q0, so3.exp(turn * since))
        return p, np.where((t - t0 > fall_s)[:, None], lies, q)

    after = mocap.time_s >= t0
    rest = mocap[list(POSE)][:1] - mocap[list(POSE)][: min(start, 200)]  # its own noise, played again on the ground
    noise = np.resize(rest, (len(mocap), 7))
    poses = mocap[list(POSE)].copy()
    p, q = pose(mocap.time_s[after])
    poses[after] = np.concatenate([p, q], axis=1) + noise[after]
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    flight = _with_poses(flight, poses)
    flight = _onboard(flight, t0, t0 + fall_s, pose, turn, blow)
    landed = t0 + float(fall_s)
    tilt = np.arccos(np.clip(so3.rotate(q, np.array([0.0, 0.0, 1.0]))[:, 2], -1.0, 1.0))
    return flight, truth("crash", "", (), (t0, landed), float(tilt.max()), "rad", "motors stopped in the air")


def _onboard(flight: Flight, t0: float, hit: float, pose: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
             turn: np.ndarray, blow: float) -> Flight:
    """The vehicle's streams during and after the fall; noise of the first second is played again."""
    def fresh(name: str, quantities: tuple[str, ...], make: Callable[[np.ndarray], np.ndarray]) -> None:
        nonlocal flight
        if name not in flight or quantities[0] not in flight[name]:
            return
        s = flight[name]
        columns = [s.index(x) for x in quantities]
        after = np.flatnonzero(s.time_s >= t0)
        still = s.values[s.time_s < s.span.start_s + 1.0][:, columns]
        noise = np.resize(still - still.mean(axis=0), (len(s), len(columns)))
        values = s.values.copy()
        values[after[:, None], columns] = make(s.time_s[after]) + noise[after]
        flight = flight.with_streams(**{name: with_values(s, values)})

    def velocity(t: np.ndarray) -> np.ndarray:
        return np.asarray(np.gradient(pose(t)[0], t, axis=0))

    def acceleration(t: np.ndarray) -> np.ndarray:
        world = np.where((t > hit)[:, None], [0.0, 0.0, GRAVITY_M_S2], 0.0)
        world = world + np.where((np.abs(t - hit) < IMPACT_S / 2)[:, None], [0.0, 0.0, abs(blow) / IMPACT_S], 0.0)
        return so3.rotate_inverse(pose(t)[1], world)

    fresh("estimator", ("x", "y", "z"), lambda t: pose(t)[0])
    fresh("estimator", ("vx", "vy", "vz"), velocity)
    fresh("attitude", ("roll", "pitch", "yaw"), lambda t: so3.euler_zyx(pose(t)[1]))
    fresh("attitude_qw", ("qx", "qy", "qz", "qw"), lambda t: pose(t)[1])
    fresh("imu", ("acc_x", "acc_y", "acc_z"), acceleration)
    fresh("imu", ("gyro_x", "gyro_y", "gyro_z"), lambda t: np.where((t <= hit)[:, None], turn, 0.0))
    fresh("motor", ("m1", "m2", "m3", "m4"), lambda t: np.zeros((len(t), 4)))
    fresh("setpoint", ("x", "y", "z", "yaw"), lambda t: np.zeros((len(t), 4)))
    return flight


ESTIMATOR_RESET = Injection(estimator_reset, (0.15, 0.5, 2.0), "m")
NEVER_FLEW = Injection(never_flew)
CRASH = Injection(crash, (0.5, 1.0), "share of the blow")
COPY = Injection(copy)

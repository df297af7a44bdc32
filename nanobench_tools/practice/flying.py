"""Flies n practice vehicles at once behind any Controller and keeps what the vehicle and the room could have seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .. import so3
from ..errors import UsageError
from ..methods import Controller, VehicleState
from ..units import GRAVITY_M_S2
from .estimator import OnboardEstimator, correlated_noise
from .plant import POSITION, QUATERNION, RATE, VELOCITY, Plant
from .references import PathSpec
from .timeline import TICK_S, Events, Timeline, draw_events
from .vehicle import Vehicles, draw_vehicles

STEP_S = 0.002
"""Step of the physics and shortest control period: 500 Hz."""
SUBSTEPS = round(TICK_S / STEP_S)

LOGGED: dict[str, tuple[int, int]] = {
    "imu": (6, 1), "motor": (4, 2), "estimator": (6, 3), "estimator_acc": (3, 4), "attitude": (3, 1),
    "attitude_qw": (4, 2), "setpoint": (4, 3), "pid": (4, 4), "battery": (1, 2),
}
"""Messages of the vehicle: number of values and the substep of each 10 ms at which they are sampled."""

TRUTH = {"position_m": 3, "velocity_m_s": 3, "quaternion": 4, "rate_rad_s": 3, "specific_force_m_s2": 3, "battery_V": 1,
         "motor": 4}
"""What is kept of the truth at every tick, and its width; ``motor`` is the PWM ratio from that tick on."""

BATTERY_NOISE_V = 0.004
GROUND_HEIGHT_M = (0.055, 0.075)
"""Where the tracked point of the resting vehicle is, lowest and highest of the recordings."""


@dataclass(frozen=True)
class Flown:
    """n flights on the 100 Hz ticks 0 .. m-1; flight i ends at ``timeline.events[i].end_s``.

    time_s (m,); truth[name] (m, n, k) SI, world and body FLU, at the tick; messages[name] (m, n, k) as the vehicle
    would log them, sampled ``LOGGED[name][1]`` substeps after the tick; logs_pid tells whether ``pid`` is meaningful.
    """

    time_s: np.ndarray
    truth: Mapping[str, np.ndarray]
    messages: Mapping[str, np.ndarray]
    timeline: Timeline
    vehicles: Vehicles
    controller: str
    logs_pid: bool

    def __len__(self) -> int:
        return len(self.timeline)

    def ticks_of(self, flight: int) -> int:
        """Number of ticks of one flight."""
        return 1 + round(self.timeline.events[flight].end_s / TICK_S)


def flight_rngs(seed: int, index: int, count: int) -> list[np.random.Generator]:
    """Independent generators of flight ``index``; they do not depend on which other flights there are."""
    return [np.random.default_rng(s) for s in np.random.SeedSequence([seed, index]).spawn(count)]


def fly(controller: Controller, specs: Sequence[PathSpec], vehicles: Vehicles | None = None, seed: int = 0, *,
        indices: Sequence[int] | None = None, spread: float = 1.0, events: Sequence[Events] | None = None) -> Flown:
    """Flies ``specs[i]`` with flight number ``indices[i]`` (default 0, 1, ...) of ``seed``, all behind one controller.

    vehicles: n of them, drawn from the table when None. ``spread`` scales the differences between flights and the
    errors of the estimator; 0 is a perfect vehicle (sensor noise stays). The controller sees the estimate, the gyro
    and the measured battery, and, unless its ``information`` is ``preview``, references as flown.
    Raises UsageError when the controller's period is not a multiple of 2 ms or its command has the wrong shape.
    """
    n = len(specs)
    every = round(controller.period_s / STEP_S)
    if every < 1 or abs(every * STEP_S - controller.period_s) > 1e-9:
        raise UsageError(f"controller {controller.name!r} has a period of {controller.period_s} s; give a multiple of 0.002")
    rngs = [flight_rngs(seed, i, 6) for i in (range(n) if indices is None else indices)]
    place, draw, error, air, sensor, volt = zip(*rngs, strict=True)
    start = np.array([[*(0.02 * r.standard_normal(2)), r.uniform(*GROUND_HEIGHT_M)] for r in place])
    yaw = spread * np.radians([3.0 * r.standard_normal() for r in place])
    timeline = Timeline(specs, [draw_events(s, r) for s, r in zip(specs, place, strict=True)] if events is None else events)
    ticks = timeline.ticks
    if vehicles is None:
        vehicles = draw_vehicles(list(draw), spread)
    plant = Plant(vehicles, start, yaw)
    estimator = OnboardEstimator(plant, list(error), ticks, STEP_S, spread)
    gusts = np.stack([correlated_noise(r, ticks, 3, 0.5) for r in air], axis=-1) * vehicles.disturbance_m_s2
    battery_noise = BATTERY_NOISE_V * np.stack([r.standard_normal(ticks) for r in volt], axis=-1)
    controller.reset(n)
    log = getattr(controller, "log", None)
    recorder = _Recorder(ticks, n)
    command = np.zeros((n, 4))
    for tick in range(ticks):
        noise = np.stack([r.standard_normal((SUBSTEPS, 9)) for r in sensor], axis=-1)
        plant.disturbance_m_s2 = gusts[tick]
        position, velocity, quaternion = estimator.read(tick)
        euler = so3.euler_zyx(quaternion)
        armed, reference, yaw_rate = timeline.at(tick, position, euler[:, 2])
        given = reference if controller.information == "preview" else timeline.as_flown(tick, reference)
        for sub in range(SUBSTEPS):
            imu = _imu(plant, noise[sub])
            if (tick * SUBSTEPS + sub) % every == 0:
                state = VehicleState(position, velocity, quaternion, imu[:, 3:], plant.battery_V + battery_noise[tick])
                command = np.asarray(controller.command(TICK_S * tick + STEP_S * sub, state, given), float)
                if command.shape != (n, 4):
                    raise UsageError(f"controller {controller.name!r} returned shape {command.shape} for {n} vehicles; "
                                     f"it must be ({n}, 4)")
            plant.apply(np.where(armed[:, None], command, 0.0))
            if sub == 0:
                recorder.truth(tick, plant)
                log = getattr(controller, "log", None)
                recorder.messages(tick, plant, position, velocity, quaternion, euler, imu, armed, reference, yaw_rate, log,
                                  battery_noise[tick])
            if sub == LOGGED["imu"][1]:
                recorder.arrays["imu"][tick] = imu
            if sub == LOGGED["motor"][1]:
                recorder.arrays["motor"][tick] = plant.motor.T
            plant.step(STEP_S)
            estimator.remember(plant.state)
    if log is None:
        recorder.arrays["pid"][:, :, 2] = recorder.arrays["attitude"][0, :, 2]
    return Flown(TICK_S * np.arange(ticks), recorder.kept, recorder.arrays, timeline, vehicles, controller.name, log is not None)


def _imu(plant: Plant, noise: np.ndarray) -> np.ndarray:
    """Accelerometer and gyro (n, 6) SI with bias, noise and, while motors turn, vibration; noise (9, n) unit normal."""
    p = plant.vehicles
    turning = 0.25 * np.sum(plant.motor, axis=0)
    acc = plant.specific_force() + (p.acc_bias_m_s2 + (p.acc_noise_m_s2 + p.acc_vibration_m_s2 * turning) * noise[0:3]).T
    gyro = plant.state[RATE] + p.gyro_bias_rad_s + (p.gyro_noise_rad_s + p.gyro_vibration_rad_s * turning) * noise[3:6]
    return np.concatenate([acc, gyro.T], axis=1)


class _Recorder:
    """The arrays of a run."""

    def __init__(self, ticks: int, n: int) -> None:
        self.kept = {name: np.zeros((ticks, n, k)) for name, k in TRUTH.items()}
        self.arrays = {name: np.zeros((ticks, n, k)) for name, (k, _) in LOGGED.items()}

    def truth(self, tick: int, plant: Plant) -> None:
        s = plant.state
        for name, rows in (("position_m", POSITION), ("velocity_m_s", VELOCITY), ("quaternion", QUATERNION),
                           ("rate_rad_s", RATE)):
            self.kept[name][tick] = s[rows].T
        self.kept["specific_force_m_s2"][tick] = plant.specific_force()
        self.kept["battery_V"][tick, :, 0] = plant.battery_V
        self.kept["motor"][tick] = plant.motor.T

    def messages(self, tick, plant, position, velocity, quaternion, euler, imu, armed, reference, yaw_rate, log,
                 battery_noise) -> None:
        """What changes at 100 Hz only. The setpoint's yaw is the planner's yaw rate, as in the published files."""
        a = self.arrays
        a["estimator"][tick] = np.concatenate([position, velocity], axis=1)
        a["estimator_acc"][tick] = so3.rotate(quaternion, imu[:, :3]) - np.array([0.0, 0.0, GRAVITY_M_S2])
        a["attitude"][tick] = euler
        a["attitude_qw"][tick] = quaternion
        a["setpoint"][tick] = np.concatenate([reference.position_m, yaw_rate[:, None]], axis=1) * armed[:, None]
        a["battery"][tick, :, 0] = plant.battery_V + battery_noise
        if log is not None:
            on = armed[:, None]
            angles = np.where(on, log.attitude_rad, euler * np.array([0.0, 0.0, 1.0]))
            a["pid"][tick] = np.concatenate([angles, log.cmd_thrust[:, None] * on], axis=1)

"""Flies n practice vehicles at once behind any Controller and keeps what the vehicle and the room could have seen."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .. import so3
from ..errors import UsageError
from ..firmware.guard import commanded
from ..firmware.onboard import ControllerLog
from ..methods import Controller, Reference, VehicleState
from ..settings import number, setting
from ..units import GRAVITY_M_S2
from .estimator import OnboardEstimator, correlated_noise
from .references import PathSpec
from .rigid_bodies import POSITION, QUATERNION, RATE, VELOCITY, Plant
from .timeline import TICK_S, Events, Timeline, draw_events
from .vehicle_parameters import Vehicles, draw_vehicles

STEP_S = 0.002
"""Step of the physics and shortest control period: 500 Hz."""
SUBSTEPS = round(TICK_S / STEP_S)

LOGGED: dict[str, tuple[int, int]] = {
    "imu": (6, 1), "motor": (4, 2), "estimator": (6, 3), "estimator_acc": (3, 4), "attitude": (3, 1),
    "attitude_qw": (4, 2), "setpoint": (4, 3), "pid": (4, 4), "battery": (1, 2),
}
"""Messages of the vehicle: number of values and the substep of each 10 ms at which they are sampled."""

TRUTH = {"position_m": 3, "velocity_m_s": 3, "quaternion": 4, "rate_rad_s": 3, "battery_V": 1, "motor": 4}
"""True quantities kept at every tick, and their width; ``motor`` is the PWM ratio from that tick on."""

NOISE_TICKS = 50
"""Sensor noise is drawn for so many ticks at once."""
BATTERY_NOISE_V = number("practice.flying.battery_noise_v")
GUST_S = number("practice.flying.gust_s")
FLICKER_S = number("practice.flying.flicker_s")
GROUND_HEIGHT_M = setting("practice.flying.ground_height_m")


@dataclass(frozen=True)
class Flown:
    """n flights on the 100 Hz ticks 0 .. m-1; flight i ends at ``timeline.events[i].end_s``.

    Recorded flights.

    - time_s (m,); truth[name] (m, n, k): SI, world and body FLU, at the tick.
    - messages[name] (m, n, k): as the vehicle would log them, sampled ``LOGGED[name][1]`` substeps after the tick.
      There is no ``pid`` when the controller has no ``log`` of its attitude commands.
    """

    time_s: np.ndarray
    truth: Mapping[str, np.ndarray]
    messages: Mapping[str, np.ndarray]
    timeline: Timeline
    vehicles: Vehicles
    controller: str

    def __len__(self) -> int:
        return len(self.timeline)

    def ticks_of(self, flight: int) -> int:
        """Number of ticks of one flight."""
        return 1 + round(self.timeline.events[flight].end_s / TICK_S)


def flight_rngs(seed: int, index: int, count: int) -> list[np.random.Generator]:
    """Independent generators of flight ``index``; they do not depend on which other flights there are."""
    return [np.random.default_rng(s) for s in np.random.SeedSequence([seed, index]).spawn(count)]


def fly(controller: Controller, specs: Sequence[PathSpec], vehicles: Vehicles | None = None, seed: int = 0, *,
        indices: Sequence[int] | None = None, spread: float = 1.0, events: Sequence[Events] | None = None,
        physics: Callable[[Vehicles, np.ndarray, np.ndarray], Plant] = Plant, drawn_s: float | None = None,
        fresh: bool = False) -> Flown:
    """Flies ``specs[i]`` with flight number ``indices[i]`` (default 0, 1, ...) of ``seed``, all behind one controller.

    vehicles: n of them, drawn from the table when None. ``spread`` scales the differences between flights and the
    errors of the estimator; 0 is a perfect vehicle (sensor noise stays). The controller sees the estimate, the gyro
    and the measured battery, and, unless its ``information`` is ``preview``, references as flown. ``physics`` makes
    the plant from vehicles, their initial positions (n, 3) m and yaw (n,) rad. ``drawn_s``: duration for which
    disturbances are drawn (by default that of the longest flight). A given value makes a flight independent of the
    length of the others. ``fresh``: the controller sees a new estimate every 2 ms, not every 10 ms. Derivatives of the
    estimate then do not jump once between two logged commands, where no recording shows it.
    Raises UsageError when the controller's period is not a multiple of 2 ms or its command has the wrong shape. Raises
    InputError when a command is not a number or lies outside 0..1.
    """
    n = len(specs)
    every = round(controller.period_s / STEP_S)
    if every < 1 or abs(every * STEP_S - controller.period_s) > 1e-9:
        raise UsageError(f"controller {controller.name!r} has a period of {controller.period_s} s; "
                         f"give a multiple of {STEP_S}")
    rngs = [flight_rngs(seed, i, 6) for i in (indices or range(n))]
    place, draw, error, air, sensor, volt = zip(*rngs, strict=True)
    start = np.array([[*(0.02 * r.standard_normal(2)), r.uniform(*GROUND_HEIGHT_M)] for r in place])
    yaw = spread * np.radians([3.0 * r.standard_normal() for r in place])
    if events is None:
        events = [draw_events(s, r) for s, r in zip(specs, place, strict=True)]
    timeline = Timeline(specs, events)
    ticks = timeline.ticks
    if vehicles is None:
        vehicles = draw_vehicles(list(draw), spread)
    drawn = ticks if drawn_s is None else max(ticks, 1 + round(drawn_s / TICK_S))
    plant = physics(vehicles, start, yaw)
    estimator = OnboardEstimator(plant, list(error), drawn, STEP_S, spread)
    gusts = np.stack([correlated_noise(r, drawn, 3, GUST_S) for r in air], axis=-1) * vehicles.disturbance_m_s2
    flicker = np.stack([correlated_noise(r, drawn, 4, FLICKER_S) for r in air], axis=-1) * vehicles.thrust_noise
    battery_noise = BATTERY_NOISE_V * np.stack([r.standard_normal(drawn) for r in volt], axis=-1)
    controller.reset(n)
    logs = isinstance(getattr(controller, "log", None), ControllerLog)
    recorder = _Recorder(ticks, n, [name for name in LOGGED if name != "pid" or logs])
    command = np.zeros((n, 4))
    for tick in range(ticks):
        if tick % NOISE_TICKS == 0:
            noises = np.stack([r.standard_normal((NOISE_TICKS, SUBSTEPS + 2, 3)) for r in sensor], axis=-1)
        noise = noises[tick % NOISE_TICKS]
        plant.disturbance_m_s2, plant.flicker = gusts[tick], flicker[tick]
        position, velocity, quaternion = estimator.read(tick)
        yaw = so3.euler_zyx(quaternion)[:, 2]
        armed, reference, yaw_rate = timeline.at(tick, position, yaw)
        given = reference if controller.information == "preview" else timeline.as_flown(tick, reference)
        for sub in range(SUBSTEPS):
            gyro = _gyro(plant, noise[sub])
            if fresh and sub:
                position, velocity, quaternion = estimator.read(tick)
            if (tick * SUBSTEPS + sub) % every == 0:
                state = VehicleState(position, velocity, quaternion, gyro, plant.battery_V + battery_noise[tick])
                command = commanded(controller, TICK_S * tick + STEP_S * sub, state, given)
            plant.apply(np.where(armed[:, None], command, 0.0))
            if sub == 0:
                log = getattr(controller, "log", None) if logs else None
                recorder.truth(tick, plant)
                recorder.believed(tick, position, velocity, quaternion, _accelerometer(plant, noise[SUBSTEPS]))
                recorder.commanded(tick, armed, reference, yaw_rate, yaw, log)
                recorder.messages["battery"][tick, :, 0] = plant.battery_V + battery_noise[tick]
            if sub == LOGGED["imu"][1]:
                acceleration = _accelerometer(plant, noise[SUBSTEPS + 1])
                recorder.messages["imu"][tick] = np.concatenate([acceleration, gyro], axis=1)
            if sub == LOGGED["motor"][1]:
                recorder.messages["motor"][tick] = plant.motor.T
            plant.step(STEP_S)
            estimator.remember(plant.state)
    return Flown(TICK_S * np.arange(ticks), recorder.kept, recorder.messages, timeline, vehicles, controller.name)


def _gyro(plant: Plant, noise: np.ndarray) -> np.ndarray:
    """Rate (n, 3) rad/s with bias, noise and, while motors turn, vibration; noise (3, n) unit normal."""
    p = plant.vehicles
    sigma = p.gyro_noise_rad_s + p.gyro_vibration_rad_s * plant.mean_ratio
    return np.asarray((plant.state[RATE] + p.gyro_bias_rad_s + sigma * noise).T)


def _accelerometer(plant: Plant, noise: np.ndarray) -> np.ndarray:
    """Specific force (n, 3) m/s^2 of the body with bias, noise and vibration; noise (3, n) unit normal."""
    p = plant.vehicles
    sigma = p.acc_noise_m_s2 + p.acc_vibration_m_s2 * plant.mean_ratio
    return np.asarray((plant.specific_force() + p.acc_bias_m_s2 + sigma * noise).T)


class _Recorder:
    """The arrays of a run."""

    def __init__(self, ticks: int, n: int, logged: Sequence[str]) -> None:
        self.kept = {name: np.zeros((ticks, n, k)) for name, k in TRUTH.items()}
        self.messages = {name: np.zeros((ticks, n, LOGGED[name][0])) for name in logged}

    def truth(self, tick: int, plant: Plant) -> None:
        for name, rows in (("position_m", POSITION), ("velocity_m_s", VELOCITY), ("quaternion", QUATERNION),
                           ("rate_rad_s", RATE)):
            self.kept[name][tick] = plant.state[rows].T
        self.kept["battery_V"][tick, :, 0] = plant.battery_V
        self.kept["motor"][tick] = plant.motor.T

    def believed(self, tick: int, position: np.ndarray, velocity: np.ndarray, quaternion: np.ndarray,
                 acceleration: np.ndarray) -> None:
        """What the estimator says; its acceleration is the accelerometer's, turned, without gravity."""
        m = self.messages
        m["estimator"][tick] = np.concatenate([position, velocity], axis=1)
        m["estimator_acc"][tick] = so3.rotate(quaternion, acceleration) - np.array([0.0, 0.0, GRAVITY_M_S2])
        m["attitude"][tick] = so3.euler_zyx(quaternion)
        m["attitude_qw"][tick] = quaternion

    def commanded(self, tick: int, armed: np.ndarray, reference: Reference, yaw_rate: np.ndarray, yaw: np.ndarray,
                  log: ControllerLog | None) -> None:
        """Setpoint and ``pid``. The setpoint's yaw is the planner's yaw rate, as in the published files. The pid's yaw
        is the estimate until take-off. An onboard controller that does not write the group keeps its first values,
        and a user's controller has no such group."""
        m, on = self.messages, armed[:, None]
        m["setpoint"][tick] = np.concatenate([reference.position_m, yaw_rate[:, None]], axis=1) * on
        if log is None:
            return
        pid = m["pid"][tick]
        pid[:, :3], pid[:, 3] = log.attitude_rad * on, log.cmd_thrust * armed
        pid[~armed, 2] = yaw[~armed]
        silent = ~log.written
        pid[silent] = m["pid"][0, silent]
        if tick == 0:
            pid[silent, 2] = yaw[silent]

"""A flight of the plant: a controller flies n vehicles along references, and what happened is kept every 10 ms."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from nanobench_tools.errors import UsageError
from nanobench_tools.firmware.guard import commanded
from nanobench_tools.methods import Controller, Reference, VehicleState
from nanobench_tools.physics.model import POSITION, QUATERNION, RATE, VELOCITY

from .plant import STEP_S, Plant
from .senses import SUBSTEPS, TICK_S

SLACK = 1e-6
"""A command may leave 0..1 by so much: rounding of a controller's own sums."""


class Senses(Protocol):
    """What ``senses`` has: called after every step, read at every tick, the gyro at every step."""

    def step(self) -> None: ...

    def read(self, tick: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...

    def gyro(self) -> np.ndarray: ...


@dataclass(frozen=True)
class Flown:
    """Truth at the ticks (m,) time_s: position_m, velocity_m_s, rate_rad_s (m, n, 3), quaternion (m, n, 4), battery_V
    (m, n); ``motor`` (m, n, 4) PWM ratio from the tick on. ``call_s`` (k,): wall clock of every command over n."""

    time_s: np.ndarray
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    quaternion: np.ndarray
    rate_rad_s: np.ndarray
    battery_V: np.ndarray
    motor: np.ndarray
    call_s: np.ndarray


def fly(plant: Plant, senses: Senses, controller: Controller, reference: Callable[[int], Reference], ticks: int, *,
        push: Callable[[float], np.ndarray] | None = None, begun: bool = False) -> Flown:
    """``ticks`` of 10 ms; ``reference(tick)`` is the controller's input then, ``push(time_s)`` (3, n) N the external
    force of the air. ``begun``: the controller goes on from where it is and is not reset.

    Raises UsageError for a period that is no multiple of 2 ms, a controller that raises or a wrong shape. Raises
    InputError for a command that is no number or outside 0..1.
    """
    n = len(plant)
    every = round(controller.period_s / STEP_S)
    if every < 1 or abs(every * STEP_S - controller.period_s) > 1e-9:
        raise UsageError(f"controller {controller.name!r} has a period of {controller.period_s} s; "
                         f"give a multiple of {STEP_S}")
    if not begun:
        controller.reset(n)
    kept = {"position_m": 3, "velocity_m_s": 3, "quaternion": 4, "rate_rad_s": 3, "battery_V": 1, "motor": 4}
    out = {name: np.zeros((ticks, n, width)) for name, width in kept.items()}
    command, calls = plant.motor.T, np.zeros(-(-ticks * SUBSTEPS // every))
    for tick in range(ticks):
        position, velocity, quaternion = senses.read(tick)
        goal = reference(tick)
        if push is not None:
            plant.force_N = push(plant.time_s)
        for name, where in (("position_m", POSITION), ("velocity_m_s", VELOCITY), ("quaternion", QUATERNION),
                            ("rate_rad_s", RATE)):
            out[name][tick] = plant.state[where].T
        for sub in range(SUBSTEPS):
            if (tick * SUBSTEPS + sub) % every == 0:
                state = VehicleState(position, velocity, quaternion, senses.gyro(), plant.battery_V)
                before = time.perf_counter()
                command = commanded(controller, TICK_S * tick + STEP_S * sub, state, goal)
                calls[(tick * SUBSTEPS + sub) // every] = (time.perf_counter() - before) / n
            plant.advance(command)
            senses.step()
            if sub == 0:
                out["motor"][tick], out["battery_V"][tick, :, 0] = plant.motor.T, plant.battery_V
    battery = out.pop("battery_V")[..., 0]
    return Flown(TICK_S * np.arange(ticks), battery_V=battery, call_s=calls, **out)

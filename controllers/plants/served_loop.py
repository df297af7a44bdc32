"""One vehicle and its firmware, millisecond by millisecond, in compiled code: IMU, loop, legs, battery, air, model.

The model's step is the machine code that ``controllers.plants.plant`` runs, called by its address.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numba as nb
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from nanobench_tools.firmware.kept import kept
from nanobench_tools.firmware.records import Record
from nanobench_tools.firmware.stabilizer import FULL, stabilizer_step
from nanobench_tools.physics.batched import LANES
from nanobench_tools.practice.rigid_bodies import (
    CONTACT_DAMPING,
    CONTACT_RAD_S,
    FRICTION,
    FRICTION_SPEED_M_S,
    LEVELLING_RAD_S,
)
from nanobench_tools.practice.vehicle_parameters import OPEN_CIRCUIT

STEP_S = 0.001
_KEY = repr((LANES, CONTACT_DAMPING, CONTACT_RAD_S, FRICTION, FRICTION_SPEED_M_S, LEVELLING_RAD_S,
             OPEN_CIRCUIT.tolist()))
"""What the machine code holds of other packages; a change of it is a change of the code that is kept."""
ADC_V, ADC_EVERY = 5.4 / 1023.0, 12
"""Step of the measured battery voltage and milliseconds between measurements (nRF firmware)."""
NOISES = 10
"""Unit normal numbers a millisecond: accelerometer, gyro, battery, air."""
AIR_S = 0.5
"""Correlation time of the unrest of the air."""

WORLD = np.dtype([
    ("steps", "i8"), ("parameters", "i8"), ("address", "i8"), ("ring", "i8"), ("whole", "i8"), ("force", "i8"),
    ("mass_kg", "f8"), ("gravity", "f8"), ("ground_z", "f8"), ("charge", "f8"), ("capacity_A_s", "f8"),
    ("resistance_ohm", "f8"), ("conductance_A_V", "f8"), ("battery_V", "f8"), ("battery_noise_V", "f8"),
    ("before_m_s", "f8", 3), ("push_N", "f8", 3), ("steady_N", "f8", 3), ("air_m_s2", "f8", 3),
    ("air_sd_m_s2", "f8"), ("sigma", "f8", 4), ("acc_bias", "f8", 3), ("motor", "f8", 4), ("floor_ratio", "f8"),
    ("floor_V", "f8")], align=True)
"""Data around the model:

- addresses of its machine code and of the force among its parameters;
- the delay of commands (depth of the ring and whole steps; 0: none), the weight, the ground, the cell;
- the unrest of the air (specific force), the IMU's noise in front of its low passes, present PWM ratios;
- the ratio and voltage below which the thrust map, a polynomial, would be negative: a motor has no thrust there."""


@intrinsic
def _model_step(typingctx: Any, address: Any, state: Any, row: Any, parameters: Any) -> tuple[Any, Callable[..., Any]]:
    """Calls ``Compiled.machine_code`` for one block of lanes: the state (17, LANES) becomes the next one."""
    signature = types.void(*[types.int64] * 4)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Sequence[Any]) -> Any:
        long, pointer = ir.IntType(64), ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer] * 4 + [long] * 5)
        function = builder.inttoptr(arguments[0], kind.as_pointer())
        state, row, parameters = (builder.inttoptr(a, pointer) for a in arguments[1:])
        lanes = [ir.Constant(long, n) for n in (LANES, 0, LANES, 1, 0)]
        builder.call(function, [state, row, parameters, state, *lanes])
        return context.get_dummy_value()

    return signature, codegen


@nb.njit()
def feel(w: Record, x: np.ndarray, noise: np.ndarray, acc_g: np.ndarray, gyro_deg_s: np.ndarray) -> None:
    """The IMU's raw sample of state x (17, lanes) and of what the velocity did in the last step; noise of unit size."""
    fx = (x[3, 0] - w.before_m_s[0]) / STEP_S
    fy = (x[4, 0] - w.before_m_s[1]) / STEP_S
    fz = (x[5, 0] - w.before_m_s[2]) / STEP_S + w.gravity
    qx, qy, qz, qw = x[6, 0], x[7, 0], x[8, 0], x[9, 0]
    mean = 0.25 * (w.motor[0] + w.motor[1] + w.motor[2] + w.motor[3])
    shake, turn = w.sigma[0] + w.sigma[1] * mean, w.sigma[2] + w.sigma[3] * mean
    acc_g[0] = (1 - 2 * (qy * qy + qz * qz)) * fx + 2 * (qx * qy + qw * qz) * fy + 2 * (qx * qz - qw * qy) * fz
    acc_g[1] = 2 * (qx * qy - qw * qz) * fx + (1 - 2 * (qx * qx + qz * qz)) * fy + 2 * (qy * qz + qw * qx) * fz
    acc_g[2] = 2 * (qx * qz + qw * qy) * fx + 2 * (qy * qz - qw * qx) * fy + (1 - 2 * (qx * qx + qy * qy)) * fz
    for k in range(3):
        acc_g[k] = (acc_g[k] + w.acc_bias[k] + shake * noise[k]) / w.gravity
        gyro_deg_s[k] = (x[10 + k, 0] + turn * noise[3 + k]) * 57.29577951308232


@nb.njit()
def _open_circuit(charge: float) -> float:
    last = len(OPEN_CIRCUIT) - 1
    if charge <= OPEN_CIRCUIT[0, 0]:  # an empty cell gives way quickly
        empty: float = max(OPEN_CIRCUIT[0, 1] + 20.0 * (charge - OPEN_CIRCUIT[0, 0]), 0.5)
        return empty
    for i in range(last):
        if charge <= OPEN_CIRCUIT[i + 1, 0]:
            share = (charge - OPEN_CIRCUIT[i, 0]) / (OPEN_CIRCUIT[i + 1, 0] - OPEN_CIRCUIT[i, 0])
            between: float = OPEN_CIRCUIT[i, 1] + share * (OPEN_CIRCUIT[i + 1, 1] - OPEN_CIRCUIT[i, 1])
            return between
    full: float = OPEN_CIRCUIT[last, 1]
    return full


@nb.njit()
def _supply(w: Record, s: Record, noise: float) -> None:
    """The cell under the motors' load, its charge, and the voltage as it is measured."""
    load = 0.0
    for i in range(4):
        load += w.motor[i] * w.motor[i]
    w.battery_V = _open_circuit(w.charge) / (1.0 + w.resistance_ohm * w.conductance_A_V * load)
    w.charge -= STEP_S * w.conductance_A_V * w.battery_V * load / w.capacity_A_s
    if w.steps % ADC_EVERY == 0:
        s.vbat_V = ADC_V * math.floor((w.battery_V + w.battery_noise_V * noise) / ADC_V + 0.5)


@nb.njit()
def touch(w: Record, x: np.ndarray, force: np.ndarray) -> None:
    """Adds the legs' push (3,) [N] for state x, and turns the body level while it is on the ground:
    ``practice.plant.legs``."""
    depth = w.ground_z - x[2, 0]
    if not depth > 0.0:
        return
    normal = max(CONTACT_RAD_S**2 * depth - 2 * CONTACT_DAMPING * CONTACT_RAD_S * x[5, 0], 0.0)
    for k in range(2):
        force[k] -= w.mass_kg * FRICTION * normal * math.tanh(x[3 + k, 0] / FRICTION_SPEED_M_S)
    force[2] += w.mass_kg * normal
    qx, qy, qz, qw = x[6, 0], x[7, 0], x[8, 0], x[9, 0]
    az, bz = 2 * (qx * qz - qw * qy), 2 * (qy * qz + qw * qx)
    side = 1.0 if 1 - 2 * (qx * qx + qy * qy) >= 0.0 else -1.0  # on its back it stays there
    share = min(normal / w.gravity, 1.0)
    x[10, 0] += STEP_S * share * (-side * LEVELLING_RAD_S**2 * bz - LEVELLING_RAD_S * x[10, 0])
    x[11, 0] += STEP_S * share * (side * LEVELLING_RAD_S**2 * az - LEVELLING_RAD_S * x[11, 0])
    x[12, 0] += STEP_S * share * -LEVELLING_RAD_S * x[12, 0]


@nb.njit()
def _write_row(w: Record, row: np.ndarray, waiting: np.ndarray) -> None:
    """Inputs of the next step as ``Plant`` writes them: motors now or when the delay began, battery."""
    least = max(w.floor_ratio, w.floor_V / w.battery_V)
    if w.ring == 0:
        for i in range(4):
            row[i, 0] = max(w.motor[i], least)
    else:
        now = (w.steps - w.whole) % w.ring
        for i in range(4):
            waiting[w.steps % w.ring, i] = w.motor[i]
            row[i, 0] = max(waiting[now, i], least)
            row[5 + i, 0] = max(waiting[(now - 1) % w.ring, i], least)
    row[4, 0] = w.battery_V


@nb.njit()
def world_step(w: Record, s: Record, x: np.ndarray, row: np.ndarray, parameters: np.ndarray, waiting: np.ndarray,
               noise: np.ndarray) -> None:
    """The vehicle a millisecond further with the motors of s; x (17, LANES), row (I, LANES), parameters (P, LANES)."""
    for i in range(4):
        w.motor[i] = min(max(s.motor[i] / FULL, 0.0), 1.0)
    _supply(w, s, noise[6])
    _write_row(w, row, waiting)
    keep, new = math.exp(-STEP_S / AIR_S), math.sqrt(1.0 - math.exp(-2.0 * STEP_S / AIR_S))
    force = np.empty(3)
    for k in range(3):
        w.air_m_s2[k] = keep * w.air_m_s2[k] + new * w.air_sd_m_s2 * noise[7 + k]
        force[k] = w.steady_N[k] + w.push_N[k] + w.mass_kg * w.air_m_s2[k]
        w.before_m_s[k] = x[3 + k, 0]
    touch(w, x, force)
    for k in range(3):
        parameters[w.force + k, 0] = force[k]
    _model_step(w.address, x.ctypes.data, row.ctypes.data, parameters.ctypes.data)  # type: ignore[call-arg]
    w.steps += 1


def _made(key: str) -> Callable[..., None]:
    @nb.njit(cache=True, nogil=True)
    def run(noise: np.ndarray, s: np.ndarray, setpoint: np.ndarray, gains: tuple[np.ndarray, ...],
            states: tuple[np.ndarray, ...], build: np.ndarray, kalman: np.ndarray, task: np.ndarray, runs: np.ndarray,
            measured: np.ndarray, waiting_poses: int, w: np.ndarray, x: np.ndarray, row: np.ndarray,
            parameters: np.ndarray, waiting: np.ndarray) -> None:
        """The loop and the vehicle for as many milliseconds as noise (n, NOISES) has rows; records (1,) go on."""
        if not key:
            return
        acc_g, gyro_deg_s = np.empty(3), np.empty(3)
        own = (gains[0][0], gains[1][0], gains[2][0])
        memory = (states[0][0], states[1][0], states[2][0])
        for k in range(len(noise)):
            feel(w[0], x, noise[k], acc_g, gyro_deg_s)
            poses = measured[:waiting_poses] if k == 0 else measured[:0]
            stabilizer_step(s[0], acc_g, gyro_deg_s, setpoint[0], own, memory, build[0], kalman[0], task[0], runs[0],
                            poses)
            world_step(w[0], s[0], x, row, parameters, waiting, noise[k])

    return run


run = kept(lambda sources: _made(sources + _KEY))

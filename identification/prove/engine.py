"""The engine that flies the cases: the practice vehicle with an airframe that is known exactly, and effects on top.

Written from the equations, not from the terms: delay, input limit, curve of the motor voltage, thrust limit, gains,
and lag (RK4, 2 ms). Then come the effects of air on the thrust, forces in the body, moments, and forces in the world.
The battery, the ground, the sensors, the onboard controllers and the room are those of the practice flights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from nanobench_tools.practice.rigid_bodies import (
    POSITION,
    QUATERNION,
    RATE,
    THRUST,
    VELOCITY,
    Plant,
    battery_voltage,
    rotation_columns,
)
from nanobench_tools.practice.vehicle_parameters import Vehicles, draw_vehicles

from .airframe import POSITIONS_M, SPIN, Airframe
from .effects.effect import HOOKS, Air, Effect

Acting = tuple[np.ndarray, Effect]
"""The vehicles (k,) of a batch that an effect acts on, and the effect."""


def _turned(columns: np.ndarray, body: np.ndarray) -> np.ndarray:
    """Body vectors (3, n) -> world, columns[j] (3, n) the body axis j seen in the world."""
    return np.asarray(columns[0] * body[0] + columns[1] * body[1] + columns[2] * body[2])


def _in_body(columns: np.ndarray, world: np.ndarray) -> np.ndarray:
    return np.asarray(columns[:, 0] * world[0] + columns[:, 1] * world[1] + columns[:, 2] * world[2])


class Engine(Plant):
    """n vehicles, vehicle i of ``airframes[i]``, under ``effects``; see ``practice.plant`` for the state."""

    def __init__(self, vehicles: Vehicles, position_m: np.ndarray, yaw_rad: np.ndarray, airframes: Sequence[Airframe],
                 effects: Sequence[Acting] = ()) -> None:
        super().__init__(vehicles, position_m, yaw_rad)
        everyone = np.arange(len(vehicles))
        self._with = {hook: [(slice(None) if np.array_equal(rows, everyone) else rows, effect)
                             for rows, effect in effects if effect.has(hook)] for hook in HOOKS}

        def each(name: str) -> np.ndarray:
            return np.ascontiguousarray(np.array([getattr(a, name) for a in airframes], float).T)

        degree = max(len(a.curve_N_V) for a in airframes)
        self._curve = np.array([(*a.curve_N_V, *[0.0] * (degree - len(a.curve_N_V))) for a in airframes]).T
        self._drag, self._drag_torque = each("drag_N_s_m"), each("drag_torque_N_s")
        self._tau_up, self._tau_down = each("tau_up_s"), each("tau_down_s")
        self._yaw_arm, self._k_f = each("yaw_arm_m"), each("k_f_N_s2")
        self._wind = np.zeros((3, len(vehicles)))
        for rows, effect in self._with["wind"]:
            self._wind[:, rows] = effect.wind()

    def forces(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """State (17, n) -> specific force in the world (3, n) m/s^2, moment (3, n) N m body, columns of R (3, 3, n)."""
        columns = np.array(rotation_columns(s[QUATERNION]))
        v, rotor_N = s[VELOCITY], s[THRUST]
        velocity_b = _in_body(columns, v)
        air_b = velocity_b - _in_body(columns, self._wind) if self._with["wind"] else velocity_b
        force_b = -self._drag * air_b
        air = Air(s[POSITION], v, velocity_b, air_b, s[RATE], np.sqrt(np.maximum(rotor_N, 0.0) / self._k_f), rotor_N,
                  force_b)
        thrust = rotor_N
        for rows, effect in self._with["thrust"]:
            thrust = thrust.copy() if thrust is rotor_N else thrust
            thrust[:, rows] = effect.thrust(thrust[:, rows], _of(air, rows))
        air.thrust = thrust
        for rows, effect in self._with["force"]:
            force_b[:, rows] += effect.force(_of(air, rows))
        force_b[2] += thrust[0] + thrust[1] + thrust[2] + thrust[3]
        moment = np.empty_like(v)
        moment[0] = -self._drag_torque * air_b[1]
        moment[1] = self._drag_torque * air_b[0]
        moment[2] = 0.0
        for (x, y), spin, t in zip(POSITIONS_M, SPIN, thrust, strict=True):
            moment[0] += y * t
            moment[1] -= x * t
            moment[2] += spin * self._yaw_arm * t
        for rows, effect in self._with["moment"]:
            moment[:, rows] += effect.moment(_of(air, rows))
        push = _turned(columns, force_b)
        for rows, effect in self._with["push"]:
            push[:, rows] += effect.push(_of(air, rows))
        force = push / self.vehicles.mass_kg + self.disturbance_m_s2
        if (s[2] < self.ground_z).any():
            self._add_contact(s, (columns[0][2], columns[1][2]), force, moment)
        return force, moment, columns

    def derivative(self, s: np.ndarray) -> np.ndarray:
        """Time derivative of the state (17, n); the rotors follow faster or slower up and down."""
        out = super().derivative(s)
        missing = self.command_N - s[THRUST]
        out[THRUST] = missing / np.where(missing > 0.0, self._tau_up, self._tau_down)
        return out

    def apply(self, motor: np.ndarray) -> None:
        """PWM ratios (n, 4) held from now on. ``motor`` keeps what was sent, which is what is logged."""
        self.motor = acts = np.clip(motor.T, 0.0, 1.0)
        for rows, effect in self._with["motor"]:
            acts = acts.copy() if acts is self.motor else acts
            acts[:, rows] = effect.motor(acts[:, rows])
        self.battery_V = battery_voltage(self.charge, acts, self.vehicles)
        self._load = np.sum(acts * acts, axis=0)
        self.mean_ratio = 0.25 * np.sum(acts, axis=0)
        volts = acts * self.battery_V
        thrust = np.zeros_like(volts)
        for c in self._curve[::-1]:
            thrust = c + volts * thrust
        for rows, effect in self._with["commanded"]:
            thrust[:, rows] = effect.commanded(thrust[:, rows])
        self.command_N = thrust * (1.0 + self.flicker)

    def step(self, dt_s: float) -> None:
        super().step(dt_s)
        for rows, effect in self._with["advance"]:
            effect.advance(dt_s, self.motor[:, rows])


class _Part:
    """Reads what the vehicles ``rows`` feel, and returns only the requested part."""

    def __init__(self, air: Air, rows: np.ndarray) -> None:
        self._air, self._rows = air, rows

    def __getattr__(self, name: str) -> np.ndarray:
        return np.asarray(getattr(self._air, name)[:, self._rows])


def _of(air: Air, rows: np.ndarray | slice) -> Any:
    """The vehicles ``rows``."""
    return air if isinstance(rows, slice) else _Part(air, rows)


def vehicles_of(airframes: Sequence[Airframe], rngs: Sequence[np.random.Generator],
                **each: Sequence[float]) -> Vehicles:
    """Batteries and sensors of n airframes; biases of the sensors differ between flights, nothing else does. ``each``
    gives further numbers (n,) of VEHICLE, such as charge_at_start."""
    made = draw_vehicles(list(rngs), 0.0, motor_imbalance=0.0)
    bias = draw_vehicles(list(rngs), 1.0)
    jx, jy, jz = (np.array([a.inertia_kg_m2[i] for a in airframes]) for i in range(3))
    return replace(made, mass_kg=np.array([a.mass_kg for a in airframes]), inertia_xx_kg_m2=jx, inertia_yy_kg_m2=jy,
                   inertia_zz_kg_m2=jz, gyro_bias_rad_s=bias.gyro_bias_rad_s, acc_bias_m_s2=bias.acc_bias_m_s2,
                   **{name: np.asarray(values, float) for name, values in each.items()})

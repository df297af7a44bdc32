"""Parameters of the practice vehicle: value, spread between flights, unit and where the number comes from."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np


class Parameter(NamedTuple):
    """``spread`` is the standard deviation between flights; drawn values stay within two spreads."""

    value: float
    spread: float
    unit: str
    source: str


VEHICLE: dict[str, Parameter] = {
    "mass_kg": Parameter(0.04085, 0.0, "kg", "NanoBench paper, weighed vehicle"),
    "inertia_xx_kg_m2": Parameter(1.8e-5, 0.0, "kg m^2", "Lee controller of the firmware 1.66e-5, scaled for the load"),
    "inertia_yy_kg_m2": Parameter(1.8e-5, 0.0, "kg m^2", "same"),
    "inertia_zz_kg_m2": Parameter(3.1e-5, 0.0, "kg m^2", "same, 2.93e-5"),
    "arm_m": Parameter(0.0325, 0.0, "m", "platform_defaults_cf2.h: 0.046 m / sqrt(2)"),
    "thrust_scale": Parameter(0.95, 0.02, "1", "NanoBench recordings: real over firmware cubic 0.943 +- 0.033"),
    "motor_imbalance": Parameter(0.0, 0.05, "1", "NanoBench recordings: PWM of the motors differs by 10 % in hover"),
    "motor_tau_s": Parameter(0.045, 0.002, "s", "NanoBench recordings: PWM differences to angular acceleration, 45 ms"),
    "yaw_arm_m": Parameter(0.006993, 0.0, "m", "platform_defaults_cf2.h THRUST2TORQUE"),
    "drag_lateral_1_s": Parameter(0.40, 0.01, "1/s", "NanoBench recordings: k/m 0.391 (x), 0.404 (y)"),
    "drag_vertical_1_s": Parameter(0.14, 0.0, "1/s", "NanoBench recordings: vertical damping"),
    "drag_torque_N_s": Parameter(-1.5e-4, 0.0, "N s", "NanoBench recordings: 6-11 rad/s^2 per m/s of lateral velocity"),
    "charge_at_start": Parameter(0.94, 0.04, "1", "NanoBench recordings: 4.0-4.23 V at rest"),
    "capacity_A_s": Parameter(900.0, 0.0, "A s", "250 mAh cell"),
    "resistance_ohm": Parameter(0.12, 0.015, "ohm", "NanoBench recordings: 0.53 V jump when the motors stop"),
    "motor_conductance_A_V": Parameter(0.47, 0.0, "A/V", "4.5 A in hover: 17 % of the cell in 35 s"),
    "disturbance_m_s2": Parameter(0.05, 0.0, "m/s^2", "chosen: air of a closed room, below the thrust residual of 0.1"),
    "thrust_noise": Parameter(0.02, 0.0, "1", "chosen to match the gyro RMS in the air: thrust of each motor flickers"),
    "gyro_noise_rad_s": Parameter(0.0025, 0.0, "rad/s", "NanoBench recordings at rest 0.002 after interpolation"),
    "gyro_vibration_rad_s": Parameter(0.006, 0.0, "rad/s", "chosen to match the 30-50 Hz level in the air"),
    "gyro_bias_rad_s": Parameter(0.0, 0.0004, "rad/s", "NanoBench recordings: flight SD 0.0003-0.0005"),
    "acc_noise_m_s2": Parameter(0.013, 0.0, "m/s^2", "NanoBench recordings at rest 0.0011 g after interpolation"),
    "acc_vibration_m_s2": Parameter(0.045, 0.0, "m/s^2", "chosen to match the 30-50 Hz level in the air"),
    "acc_bias_m_s2": Parameter(0.0, 0.02, "m/s^2", "order of the BMI088 after calibration"),
}
"""The only place with numbers of the vehicle. Keys carry the unit."""

OPEN_CIRCUIT = np.array([[0.0, 3.30], [0.1, 3.60], [0.3, 3.72], [0.55, 3.82], [0.8, 3.98], [1.0, 4.23]])
"""Charge left (share) and open-circuit voltage [V] of a LiPo cell; typical curve, ends fitted to the rest voltages."""


@dataclass(frozen=True)
class Vehicles:
    """n vehicles, one number each: every field (n,) but motor_gain (4, n), gyro_bias_rad_s and acc_bias_m_s2 (3, n)."""

    mass_kg: np.ndarray
    inertia_xx_kg_m2: np.ndarray
    inertia_yy_kg_m2: np.ndarray
    inertia_zz_kg_m2: np.ndarray
    arm_m: np.ndarray
    thrust_scale: np.ndarray
    motor_gain: np.ndarray
    motor_tau_s: np.ndarray
    yaw_arm_m: np.ndarray
    drag_lateral_1_s: np.ndarray
    drag_vertical_1_s: np.ndarray
    drag_torque_N_s: np.ndarray
    charge_at_start: np.ndarray
    capacity_A_s: np.ndarray
    resistance_ohm: np.ndarray
    motor_conductance_A_V: np.ndarray
    disturbance_m_s2: np.ndarray
    thrust_noise: np.ndarray
    gyro_noise_rad_s: np.ndarray
    gyro_vibration_rad_s: np.ndarray
    gyro_bias_rad_s: np.ndarray
    acc_noise_m_s2: np.ndarray
    acc_vibration_m_s2: np.ndarray
    acc_bias_m_s2: np.ndarray

    def __len__(self) -> int:
        return self.mass_kg.shape[-1]


def draw_vehicles(rngs: list[np.random.Generator], spread: float = 1.0, **fixed: float) -> Vehicles:
    """One vehicle per generator from VEHICLE; ``spread`` 0 gives the nominal one, ``fixed`` names win over the table.

    Raises KeyError for a name that is not in the table. The four motor gains have mean 1.
    """
    unknown = set(fixed) - set(VEHICLE)
    if unknown:
        raise KeyError(f"no vehicle parameter {', '.join(sorted(unknown))}; known: {', '.join(VEHICLE)}")
    several = {"motor_imbalance": 4, "gyro_bias_rad_s": 3, "acc_bias_m_s2": 3}
    drawn: dict[str, list] = {name: [] for name in VEHICLE}
    for rng in rngs:
        for name, p in VEHICLE.items():
            shape = several.get(name, ())
            value = p.value + spread * p.spread * np.clip(rng.standard_normal(shape), -2.0, 2.0)
            drawn[name].append(np.broadcast_to(fixed.get(name, value), shape))
    rows = {name: np.stack(values, axis=-1) for name, values in drawn.items()}
    imbalance = rows.pop("motor_imbalance")
    rows["motor_gain"] = 1.0 + imbalance - imbalance.mean(axis=0)
    return Vehicles(**{f.name: np.ascontiguousarray(rows[f.name]) for f in fields(Vehicles)})

"""Parameters of the practice vehicle: value, spread between flights, unit and where the number comes from."""

from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from ..settings import setting


class Parameter(NamedTuple):
    """``spread`` is the standard deviation between flights; drawn values stay within two spreads."""

    value: float
    spread: float
    unit: str
    source: str


NUMBERS: dict[str, tuple[float, float, str, str]] = setting("practice.vehicle_parameters.numbers")
VEHICLE: dict[str, Parameter] = {name: Parameter(*entry) for name, entry in NUMBERS.items()}
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
        return int(self.mass_kg.shape[-1])


def draw_vehicles(rngs: list[np.random.Generator], spread: float = 1.0, **fixed: float) -> Vehicles:
    """One vehicle per generator from VEHICLE; ``spread`` 0 gives the nominal one, ``fixed`` names win over the table.

    Raises KeyError for a name that is not in the table. The four motor gains have mean 1.
    """
    unknown = set(fixed) - set(VEHICLE)
    if unknown:
        raise KeyError(f"no vehicle parameter {', '.join(sorted(unknown))}; known: {', '.join(VEHICLE)}")
    several = {"motor_imbalance": 4, "gyro_bias_rad_s": 3, "acc_bias_m_s2": 3}
    drawn: dict[str, list[Any]] = {name: [] for name in VEHICLE}
    for rng in rngs:
        for name, p in VEHICLE.items():
            shape = several.get(name, ())
            value = p.value + spread * p.spread * np.clip(rng.standard_normal(shape), -2.0, 2.0)
            drawn[name].append(np.broadcast_to(fixed.get(name, value), shape))
    rows = {name: np.stack(values, axis=-1) for name, values in drawn.items()}
    imbalance = rows.pop("motor_imbalance")
    rows["motor_gain"] = 1.0 + imbalance - imbalance.mean(axis=0)
    return Vehicles(**{f.name: np.ascontiguousarray(rows[f.name]) for f in fields(Vehicles)})

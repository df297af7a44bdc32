"""The vehicle of a case: every number the engine flies with, and the simulator.toml that says exactly the same.

How the engine's numbers map to the terms of a simulator (``engine`` writes the equations again):

- motor voltage polynomial -> thrust_voltage; time constants up and down -> motor_lag;
- yaw_arm_m -> yaw_torque k_m; drag N s/m per body axis -> drag_linear; drag_torque_N_s -> drag_torque;
- k_f -> thrust_rpm (only turns thrust into rotor speed, where rotor drag or gyroscopic moments need it);
- mass, inertia, motor positions -> [vehicle].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nanobench_tools.firmware.thrust_curve import THRUST_MAX_N, voltage_of_thrust
from nanobench_tools.physics.model import Model
from nanobench_tools.physics.vehicle import Vehicle
from nanobench_tools.units import GRAVITY_M_S2

CURVE_N_V = (0.0, 0.03104914, -0.01274291, 0.00478576)
"""Thrust [N] of a motor as a polynomial of its voltage. It is the firmware's cubic times 0.95, refitted over 1.2-3.8 V
with no constant, within 2 mN. It rises everywhere and is zero at rest: no clipping is needed, which a simulator lacks.
"""
LIFT = 1.16
"""Least share of the weight that full command lifts, for an airframe without effects."""
ARM_M = 0.0325
SPIN = (-1.0, 1.0, -1.0, 1.0)
POSITIONS_M = ((ARM_M, -ARM_M), (-ARM_M, -ARM_M), (-ARM_M, ARM_M), (ARM_M, ARM_M))


@dataclass(frozen=True)
class Airframe:
    """SI; body axes x, y, z (FLU). The defaults are the nominal practice vehicle."""

    mass_kg: float = 0.0395
    inertia_kg_m2: tuple[float, float, float] = (1.8e-5, 1.8e-5, 3.1e-5)
    curve_N_V: tuple[float, ...] = CURVE_N_V
    yaw_arm_m: float = 0.006993
    tau_up_s: float = 0.040
    tau_down_s: float = 0.045
    drag_N_s_m: tuple[float, float, float] = (0.016, 0.016, 0.0056)
    drag_torque_N_s: float = -1.2e-4
    k_f_N_s2: float = 2.3e-8

    def model(self) -> Model:
        """What a simulator that knows everything about this airframe believes; inputs at 100 Hz."""
        drag = {"drag_linear": {"d": self.drag_N_s_m}} if any(self.drag_N_s_m) else {}
        return Model(Vehicle(self.mass_kg, self.inertia_kg_m2, POSITIONS_M, SPIN),
                     {"thrust_voltage": {"c": self.curve_N_V}, "thrust_rpm": {"k_f": self.k_f_N_s2},
                      "motor_lag": {"tau_up_s": self.tau_up_s, "tau_down_s": self.tau_down_s},
                      "yaw_torque": {"k_m": self.yaw_arm_m}, **drag, "drag_torque": {"c": self.drag_torque_N_s}})

    def lift(self) -> float:
        """Thrust at the onboard controllers' full command over the weight; the command is capped, not the battery."""
        full_V = float(voltage_of_thrust(np.array(THRUST_MAX_N)))
        most_N = 4.0 * sum(c * full_V**k for k, c in enumerate(self.curve_N_V))
        return most_N / (self.mass_kg * GRAVITY_M_S2)

    def hover_V(self) -> float:
        """Motor voltage at which four motors carry the weight [V]."""
        volts = np.linspace(0.5, 4.2, 400)
        thrust = sum(c * volts**k for k, c in enumerate(self.curve_N_V))
        return float(np.interp(self.mass_kg * GRAVITY_M_S2 / 4.0, thrust, volts))


def draw_airframe(rng: np.random.Generator) -> Airframe:
    """Vehicles differ as individuals of one type do: mass 3 %, inertia 6 %, thrust 3 %, lag, drag and torque 15 %.
    Those whose controller could not hold them well in the air are drawn again."""
    while (found := _draw(rng)).lift() < LIFT:
        pass
    return found


def _draw(rng: np.random.Generator) -> Airframe:
    def about(value: float, share: float) -> float:
        return float(f"{value * (1.0 + share * np.clip(rng.standard_normal(), -2.0, 2.0)):.4g}")

    def each(values: tuple[float, float, float], share: float) -> tuple[float, float, float]:
        x, y, z = values
        return about(x, share), about(y, share), about(z, share)

    base = Airframe()
    scale = about(1.0, 0.03)
    tau = about(base.tau_up_s, 0.1)
    return Airframe(
        about(base.mass_kg, 0.03), each(base.inertia_kg_m2, 0.06),
        tuple(float(f"{scale * c:.6g}") for c in base.curve_N_V), about(base.yaw_arm_m, 0.08), tau,
        float(f"{tau * rng.uniform(1.0, 1.25):.4g}"), each(base.drag_N_s_m, 0.15),
        about(base.drag_torque_N_s, 0.15), about(base.k_f_N_s2, 0.08))

"""Geometric control on SE(3) for the recorded vehicle.

The equations are the firmware's (``nanobench_tools.firmware.lee``) with the moment that it omits. This file has the
numbers of the vehicle and gains for its slow motors.

References
----------
Lee, Leok, McClamroch 2010, "Geometric tracking control of a quadrotor UAV on SE(3)", CDC, doi:10.1109/CDC.2010.5717652.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from nanobench_tools.firmware import lee
from nanobench_tools.firmware.onboard import Lee
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.physics import Model
from nanobench_tools.physics.vehicle import Vehicle
from nanobench_tools.settings import number, setting

from .gains import Gain, around, whole

THRUST_SCALE = number("control.geometric.thrust_scale")
POSITION_1_S2 = setting("control.geometric.position_1_s2")
VELOCITY_1_S = setting("control.geometric.velocity_1_s")
INTEGRAL_1_S3 = setting("control.geometric.integral_1_s3")
DRAG_1_S = setting("control.geometric.drag_1_s")
ROTATION_1_S2 = setting("control.geometric.rotation_1_s2")
RATE_1_S = setting("control.geometric.rate_1_s")
TURN_INTEGRAL_1_S3 = setting("control.geometric.turn_integral_1_s3")
"""Per unit of inertia."""
LAG_S = number("control.geometric.lag_s")
"""Lag of the motors for which these gains are."""
ERROR_LIMITS = setting("control.geometric.error_limits")


TUNABLE = {
    "position_level": around(POSITION_1_S2[0], "1/s^2"), "position_up": around(POSITION_1_S2[2], "1/s^2"),
    "velocity_level": around(VELOCITY_1_S[0], "1/s"), "velocity_up": around(VELOCITY_1_S[2], "1/s"),
    "integral_level": around(INTEGRAL_1_S3[0], "1/s^3"), "integral_up": around(INTEGRAL_1_S3[2], "1/s^3"),
    "rotation_tilt": around(ROTATION_1_S2[0], "1/s^2"), "rotation_yaw": around(ROTATION_1_S2[2], "1/s^2"),
    "rate_tilt": around(RATE_1_S[0], "1/s"), "rate_yaw": around(RATE_1_S[2], "1/s"),
    "turn_integral": around(TURN_INTEGRAL_1_S3[0], "1/s^3")}


def slowest_lag_s(model: Model) -> float:
    """Of its motors, up or down, which decides what is stable; LAG_S for a model without a lag."""
    return max([LAG_S, *model.values_of("motor_lag").values()]) if "motor_lag" in model else LAG_S


def parameters(vehicle: Vehicle, gains: Mapping[str, float] | None = None) -> np.ndarray:
    """(1,) PARAMETERS of the firmware's controller for a vehicle; ``gains`` by the names of TUNABLE."""
    found = lee.defaults()
    k = whole(TUNABLE, gains, "geometric")

    def three(name: str, other: str) -> tuple[float, float, float]:
        first = k[f"{name}_{'tilt' if other == 'yaw' else 'level'}"]
        return first, first, k[f"{name}_{other}"]

    inertia = np.array(vehicle.inertia_kg_m2)
    found["mass_kg"], found["inertia_kg_m2"], found["coupling"] = vehicle.mass_kg, inertia, 1.0
    found["kp_1_s2"], found["kd_1_s"] = three("position", "up"), three("velocity", "up")
    found["ki_1_s3"] = three("integral", "up")
    found["error_limit_m"], found["error_limit_m_s"] = ERROR_LIMITS
    found["k_rotation_N_m"], found["k_rate_N_m_s"] = inertia * three("rotation", "yaw"), inertia * three("rate", "yaw")
    found["k_integral_N_m_s"] = inertia * (k["turn_integral"], k["turn_integral"], TURN_INTEGRAL_1_S3[2])
    return found


class Geometric(Lee):
    """Geometric control on SE(3): full references in (position to jerk, yaw and its rate), motor PWM out, at 500 Hz.

    Torques for motors slower than LAG_S pass a lead, behind which a motor with ``lag_s`` follows like one with LAG_S.

    Parameters
    ----------
    vehicle : Vehicle, optional
        Mass, inertia and motor positions, SI; default: the recorded vehicle.
    thrust_scale : float
        Thrust of the motors over that of the firmware's curve.
    gains : mapping, optional
        Values of the gains below, by name.
    lag_s : float
        Time constant of the motors, s.
    """

    name = "geometric"
    tunable: Mapping[str, Gain] = TUNABLE

    def __init__(self, vehicle: Vehicle | None = None, thrust_scale: float = THRUST_SCALE,
                 gains: Mapping[str, float] | None = None, lag_s: float = LAG_S) -> None:
        super().__init__(parameters(vehicle or Vehicle(), gains))
        self.thrust_scale, self.lead = thrust_scale, max(lag_s / LAG_S, 1.0)

    def reset(self, n: int) -> None:
        super().reset(n)
        self._followed_N_m = np.zeros((n, 3))

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        """PWM ratios (n, 4), finite and within 0..1 for any input; drag along the reference is fed forward."""
        with np.errstate(all="ignore"):
            pushed = reference.acceleration_m_s2 + DRAG_1_S * np.asarray(reference.velocity_m_s)
        return super().command(time_s, state, replace(reference, acceleration_m_s2=pushed))

    def _drive(self, control: np.ndarray, battery_V: np.ndarray) -> np.ndarray:
        wanted = np.nan_to_num(control["torque_N_m"].astype(float))  # one that is no number must not stay
        share = 1.0 - math.exp(-1e-3 * self._motors.milliseconds / LAG_S)
        self._followed_N_m += share * (wanted - self._followed_N_m)
        control["torque_N_m"] = self.lead * wanted - (self.lead - 1.0) * self._followed_N_m
        for name in ("thrust_N", "torque_N_m"):
            control[name] /= self.thrust_scale
        return super()._drive(control, battery_V)

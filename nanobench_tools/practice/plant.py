"""The practice vehicle in the air and on the ground: n rigid bodies at once, RK4.

States are kept component first, (17, n), so that every operation runs over the vehicles; ``Plant`` shows
them with the vehicle first. Nothing sums over vehicles, so a vehicle flies the same alone as in a crowd.
Equations (DESIGN terms): m dv/dt = sum T_i R e3 - drag - m g e3 + contact, J dw/dt = tau - w x J w,
tau dT_i/dt = T_cmd_i - T_i, T_cmd_i = scale gain_i cubic(u_i V).
"""

from __future__ import annotations

import numpy as np

from ..frames import MOTOR_SIGNS
from ..units import GRAVITY_M_S2
from .thrust_curve import thrust_of_voltage
from .vehicle import OPEN_CIRCUIT, Vehicles

POSITION, VELOCITY, QUATERNION, RATE, THRUST = slice(0, 3), slice(3, 6), slice(6, 10), slice(10, 13), slice(13, 17)
STATES = 17

CONTACT_RAD_S = 200.0
"""Eigenfrequency of the legs on the ground; sinks 0.25 mm under the weight, a bounce lasts 16 ms."""
CONTACT_DAMPING = 0.35
"""Share of critical damping; rebounds by about a third of the speed."""
FRICTION = 0.6
"""Coulomb coefficient of the legs (rubber on mat), smoothed below FRICTION_SPEED_M_S."""
FRICTION_SPEED_M_S = 0.02
LEVELLING_RAD_S = 60.0
"""Eigenfrequency with which four legs press the body level while the whole weight stands on them."""


def battery_voltage(charge: np.ndarray, motor: np.ndarray, vehicles: Vehicles) -> np.ndarray:
    """Charge left (n,), PWM ratios (4, n) -> terminal voltage (n,) V.

    Each motor draws u_i (u_i V) G from the cell, so V = OCV - R G V sum u_i^2 has a closed solution.
    """
    load = vehicles.resistance_ohm * vehicles.motor_conductance_A_V * np.sum(motor * motor, axis=0)
    return np.interp(charge, OPEN_CIRCUIT[:, 0], OPEN_CIRCUIT[:, 1]) / (1.0 + load)


def rotation_rows(q: np.ndarray) -> np.ndarray:
    """Quaternions (4, n) x, y, z, w -> rotation matrices (3, 3, n), body to world."""
    x, y, z, w = q
    x2, y2, z2 = x + x, y + y, z + z
    xx, yy, zz, xy, xz, yz, wx, wy, wz = x * x2, y * y2, z * z2, x * y2, x * z2, y * z2, w * x2, w * y2, w * z2
    return np.stack([1.0 - (yy + zz), xy - wz, xz + wy,
                     xy + wz, 1.0 - (xx + zz), yz - wx,
                     xz - wy, yz + wx, 1.0 - (xx + yy)]).reshape(3, 3, -1)


class Plant:
    """n vehicles from rest on the ground; ``step`` advances all by one period.

    position_m (n, 3) of the ground contact point's world place, yaw_rad (n,); ``ground_z`` (n,) is the height
    at which a vehicle stands. ``gravity`` and ``contact`` may be switched off by tests.
    """

    def __init__(self, vehicles: Vehicles, position_m: np.ndarray, yaw_rad: np.ndarray, *,
                 gravity_m_s2: float = GRAVITY_M_S2) -> None:
        n = len(vehicles)
        self.vehicles, self.gravity = vehicles, gravity_m_s2
        self.state = np.zeros((STATES, n))
        self.state[POSITION] = position_m.T
        self.state[8], self.state[9] = np.sin(yaw_rad / 2.0), np.cos(yaw_rad / 2.0)
        self.ground_z = position_m[:, 2] + gravity_m_s2 / CONTACT_RAD_S**2
        self.charge = vehicles.charge_at_start.copy()
        self.battery_V = battery_voltage(self.charge, np.zeros((4, n)), vehicles)
        self.command_N = np.zeros((4, n))
        self.motor = np.zeros((4, n))
        self.disturbance_m_s2 = np.zeros((3, n))

    def forces(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """State (17, n) -> specific force in the world (3, n) m/s^2, moment (3, n) N m body, rotation (3, 3, n)."""
        p = self.vehicles
        r = rotation_rows(s[QUATERNION])
        v, w, thrust = s[VELOCITY], s[RATE], s[THRUST]
        up = r[:, 2]
        along = v[0] * up[0] + v[1] * up[1] + v[2] * up[2]
        lift = (thrust[0] + thrust[1] + thrust[2] + thrust[3]) / p.mass_kg
        force = up * (lift + (p.drag_lateral_1_s - p.drag_vertical_1_s) * along) - p.drag_lateral_1_s * v
        force += self.disturbance_m_s2
        vx = v[0] * r[0, 0] + v[1] * r[1, 0] + v[2] * r[2, 0]
        vy = v[0] * r[0, 1] + v[1] * r[1, 1] + v[2] * r[2, 1]
        moment = np.empty_like(w)
        for axis in range(3):
            a, b, c, d = (sign for sign in MOTOR_SIGNS[:, axis])
            moment[axis] = a * thrust[0] + b * thrust[1] + c * thrust[2] + d * thrust[3]
        moment[0] = moment[0] * p.arm_m - p.drag_torque_N_s * vy
        moment[1] = moment[1] * p.arm_m + p.drag_torque_N_s * vx
        moment[2] *= p.yaw_arm_m
        depth = self.ground_z - s[2]
        if np.any(depth > 0.0):
            self._add_contact(np.maximum(depth, 0.0), v, w, r, force, moment)
        return force, moment, r

    def _add_contact(self, depth, v, w, r, force, moment) -> None:
        """Spring, damper, friction and levelling of the legs; exactly zero for a vehicle in the air."""
        p = self.vehicles
        on = depth > 0.0
        normal = np.where(on, np.maximum(CONTACT_RAD_S**2 * depth - 2 * CONTACT_DAMPING * CONTACT_RAD_S * v[2], 0.0), 0.0)
        force[2] += normal
        force[:2] -= FRICTION * normal * np.tanh(v[:2] / FRICTION_SPEED_M_S)
        share = np.minimum(normal / GRAVITY_M_S2, 1.0)
        # moment that turns body z towards world z, seen in the body: (R^T e3) x e3 has the sign of the tilt
        moment[0] += share * p.inertia_xx_kg_m2 * (-LEVELLING_RAD_S**2 * r[2, 1] - LEVELLING_RAD_S * w[0])
        moment[1] += share * p.inertia_yy_kg_m2 * (LEVELLING_RAD_S**2 * r[2, 0] - LEVELLING_RAD_S * w[1])
        moment[2] -= share * p.inertia_zz_kg_m2 * LEVELLING_RAD_S * w[2]

    def derivative(self, s: np.ndarray) -> np.ndarray:
        """Time derivative of the state (17, n)."""
        p = self.vehicles
        force, moment, _ = self.forces(s)
        x, y, z, qw = s[QUATERNION]
        wx, wy, wz = s[RATE]
        out = np.empty_like(s)
        out[POSITION] = s[VELOCITY]
        out[VELOCITY] = force
        out[5] -= self.gravity
        hx, hy, hz = 0.5 * wx, 0.5 * wy, 0.5 * wz
        out[6] = qw * hx + y * hz - z * hy
        out[7] = qw * hy + z * hx - x * hz
        out[8] = qw * hz + x * hy - y * hx
        out[9] = -(x * hx + y * hy + z * hz)
        jx, jy, jz = p.inertia_xx_kg_m2, p.inertia_yy_kg_m2, p.inertia_zz_kg_m2
        out[10] = (moment[0] - (jz - jy) * wy * wz) / jx
        out[11] = (moment[1] - (jx - jz) * wz * wx) / jy
        out[12] = (moment[2] - (jy - jx) * wx * wy) / jz
        out[THRUST] = (self.command_N - s[THRUST]) / p.motor_tau_s
        return out

    def apply(self, motor: np.ndarray) -> None:
        """PWM ratios (n, 4), clipped to 0..1, held from now on; sets battery_V and the thrust they ask for."""
        u = np.clip(motor.T, 0.0, 1.0)
        p = self.vehicles
        self.battery_V = battery_voltage(self.charge, u, p)
        self.motor = u
        self.command_N = p.thrust_scale * p.motor_gain * thrust_of_voltage(u * self.battery_V)

    def step(self, dt_s: float) -> None:
        """One RK4 step [s] with the held command; the quaternion is normalised, the cell discharged."""
        s = self.state
        k1 = self.derivative(s)
        k2 = self.derivative(s + (0.5 * dt_s) * k1)
        k3 = self.derivative(s + (0.5 * dt_s) * k2)
        k4 = self.derivative(s + dt_s * k3)
        s = s + (dt_s / 6.0) * (k1 + 2.0 * (k2 + k3) + k4)
        q = s[QUATERNION]
        q /= np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        self.state = s
        current = self.vehicles.motor_conductance_A_V * self.battery_V * np.sum(self.motor * self.motor, axis=0)
        self.charge = self.charge - dt_s * current / self.vehicles.capacity_A_s

    def specific_force(self) -> np.ndarray:
        """What an ideal accelerometer shows, body frame (n, 3) m/s^2."""
        force, _, r = self.forces(self.state)
        return np.stack([force[0] * r[0, k] + force[1] * r[1, k] + force[2] * r[2, k] for k in range(3)], axis=1)
